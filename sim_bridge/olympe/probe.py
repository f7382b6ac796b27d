"""Probe of an address for a drone or a remote control, before the SDK connects."""

from __future__ import annotations

import ipaddress
import json
import socket
from typing import Final

from sim_bridge.olympe.config import OlympeConfig
from uav_bt.errors import DroneError

LIMIT_S: Final = 2.0  # of an answer; chosen: a drone in reach answers within milliseconds
_SKYCONTROLLER_HOST: Final = "192.168.53.1"  # over USB; from Parrot's documentation
_SKYCONTROLLER_3: Final = 0x0918  # model number, from ARSDK's device types
_ANNOUNCEMENT_BYTES: Final = 4096  # chosen: an announcement has about 100, in one packet
_HINTS: Final = {
    "anafi": (
        "switch the drone on, join its Wi-Fi (or plug the SkyController in and use "
        f"anafi:{_SKYCONTROLLER_HOST}), and try again"
    ),
    "sphinx": "start Sphinx and its drone, and try again",
}


def probe(config: OlympeConfig) -> bool:
    """Return whether a remote control answers (True) or a drone (False); DroneError if nothing.

    The SDK alone would wait for 45 s.
    """
    address = config.host, config.discovery_port
    try:
        with socket.create_connection(address, timeout=LIMIT_S) as connection:
            model = _model(connection)
    except TimeoutError as error:
        reason = f"no answer from {config.where} within {LIMIT_S:g} s"
        raise DroneError(f"{reason}: {_hint(config)}") from error
    except socket.gaierror as error:
        raise DroneError(f"the host '{config.host}' is unknown: check its spelling") from error
    except OSError as error:
        reason = f"cannot reach {config.where} ({error.strerror or error})"
        raise DroneError(f"{reason}: {_hint(config)}") from error
    return model == _SKYCONTROLLER_3 or config.host == _SKYCONTROLLER_HOST


def _model(connection: socket.socket) -> int | None:
    """Return the announced model; None without one, which the SDK reports as an error."""
    try:
        announcement = connection.recv(_ANNOUNCEMENT_BYTES).partition(b"\0")[0]
        return int(json.loads(announcement)["model.id"], 16)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _hint(config: OlympeConfig) -> str:
    try:
        loopback = ipaddress.ip_address(config.host).is_loopback
    except ValueError:
        loopback = config.host == "localhost"
    if not loopback:
        return _HINTS[config.kind]
    where = "" if config.host in ("127.0.0.1", "localhost") else f" --address {config.host}"
    return f"start a loopback ANAFI there with `uav-bt serve-anafi{where}`"
