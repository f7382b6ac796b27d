"""A loopback ANAFI in a separate process, for benchmarks that fly it."""

from __future__ import annotations

import ipaddress
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from uav_bt.errors import InputError

OLYMPE_DRONES = ("anafi", "sphinx")


def loopback_address(drone: str) -> str | None:
    """Return the address of a drone that is flown over Olympe, None of any other drone.

    Args:
        drone: NAME or NAME:ADDRESS.

    Raises:
        InputError: the address is not one of this machine alone; no benchmark flies a real drone.
    """
    name, _, address = drone.partition(":")
    if name not in OLYMPE_DRONES:
        return None
    try:
        loopback = ipaddress.ip_address(address).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise InputError(
            f"'{drone}': benchmarks fly over Olympe to loopback ANAFIs only; expected an address "
            f"from 127.0.0.1 on, such as {name}:127.0.0.2"
        )
    return address


@contextmanager
def served(
    address: str,
    *options: str,
    scene: str,
    seed: int,
    rate_hz: float,
    python: str = sys.executable,
) -> Iterator[list[str]]:
    """Serve a drone while this lasts; give the lines that it printed in the end.

    Args:
        address: where.
        options: of `uav-bt serve-anafi`, besides these.
        scene: the lab.
        seed: of everything random.
        rate_hz: of the video.
        python: that serves it.

    Raises:
        InputError: it could not be served.
    """
    arguments = [
        *(python, "-m", "uav_bt", "serve-anafi", "--address", address, "--scene", scene),
        *("--seed", str(seed), "--rate", f"{rate_hz:g}", *options),
    ]
    server = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)  # noqa: S603
    printed: list[str] = []
    try:
        assert server.stdout is not None  # noqa: S101  (asked for above)
        if not server.stdout.readline():  # printed once it listens
            raise InputError(f"no loopback ANAFI can be served at {address}")
        yield printed
    finally:
        server.terminate()
        printed += server.communicate()[0].splitlines()
