"""What goes wrong between an unmodified Olympe and the loopback ANAFI, and what becomes of it.

Run from the repository, with the Python of an environment that has Olympe; the drones listen on
ports 80 and 554 of loopback addresses, which take root::

    python benchmarks/loopback_faults.py --python /path/to/venv/bin/python

Fifty connections; three drones at once; a client killed in flight; a drone killed in flight; a
network that drops, doubles and reorders 5 % of the datagrams each.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from lossy_proxy import Loss, LossyProxy

HERE = Path(__file__).parent
CLIENTS, FAULTS = HERE / "olympe_clients", HERE / "olympe_faults"
PATIENCE_S = 240.0


class FaultError(Exception):
    """Something else happened than should."""


@asynccontextmanager
async def served(address: str) -> AsyncIterator[Process]:
    """Run a loopback ANAFI."""
    server = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "uav_bt.cli", "serve-anafi", "--address", address), stdout=PIPE
    )
    try:
        if server.stdout is None or not (await server.stdout.readline()).startswith(b"'ANAFI"):
            raise SystemExit("the loopback ANAFI did not start")
        yield server
        if server.returncode not in (None, -signal.SIGKILL):
            raise FaultError("the server died")
    finally:
        if server.returncode is None:
            server.send_signal(signal.SIGINT)
            await server.wait()


class Script:
    """An Olympe script in a process of its own."""

    def __init__(self, process: Process) -> None:
        self.process = process

    @classmethod
    async def start(cls, python: str, path: Path, address: str, **env: str) -> Script:
        """Start it against the drone at an address."""
        return cls(
            await asyncio.create_subprocess_exec(
                *(python, str(path)),
                env=os.environ | {"DRONE_IP": address} | env,
                stdin=PIPE,
                stdout=PIPE,
                stderr=asyncio.subprocess.DEVNULL,
            )
        )

    async def says(self, word: str) -> None:
        """Wait for a line."""
        assert self.process.stdout is not None  # noqa: S101  (asked for above)
        while line := await asyncio.wait_for(self.process.stdout.readline(), PATIENCE_S):
            if line.decode().strip() == word:
                return
        raise FaultError(f"the script ended without saying {word!r}")

    async def go_on(self) -> None:
        """Press return."""
        assert self.process.stdin is not None  # noqa: S101  (asked for above)
        self.process.stdin.write(b"\n")
        await self.process.stdin.drain()

    async def ends(self) -> str:
        """Wait for its end; return its last line that is not of Olympe's log."""
        said, _ = await asyncio.wait_for(self.process.communicate(), PATIENCE_S)
        if self.process.returncode != 0:
            raise FaultError(f"the script ended with {self.process.returncode}")
        lines = [line for line in said.decode().splitlines() if line and line[:2] != "20"]
        return lines[-1] if lines else ""


async def run(python: str, path: Path, address: str, **env: str) -> str:
    """Run a script to its end."""
    return await (await Script.start(python, path, address, **env)).ends()


async def fifty_connections(python: str) -> str:
    """Connect and disconnect, a new object each time."""
    async with served("127.0.2.1"):
        return await run(python, CLIENTS / "reconnect.py", "127.0.2.1", CONNECTIONS="50")


async def three_drones(python: str) -> str:
    """Three drones at once, each with a client that flies a square."""
    addresses = [f"127.0.2.{number}" for number in (2, 3, 4)]
    async with served(addresses[0]), served(addresses[1]), served(addresses[2]):
        await asyncio.gather(*(run(python, CLIENTS / "move_by.py", at) for at in addresses))
    return "three squares flown"


async def client_killed(python: str) -> str:
    """A client that dies with the stick forward leaves a drone that hovers."""
    async with served("127.0.2.5") as server:
        script = await Script.start(python, FAULTS / "flies_on.py", "127.0.2.5")
        await script.says("flying")
        script.process.kill()
        await script.process.wait()
        said = await run(python, FAULTS / "lands_it.py", "127.0.2.5")
        if server.returncode is not None:
            raise FaultError("the server died")
    return said


async def drone_killed(python: str) -> str:
    """A client whose drone dies is told so, and finds the next one."""
    async with served("127.0.2.6") as server:
        script = await Script.start(python, FAULTS / "is_left.py", "127.0.2.6")
        await script.says("flying")
        server.kill()
        await server.wait()
    await script.go_on()
    await script.says("left")
    async with served("127.0.2.6"):
        await script.go_on()
        return await script.ends()


async def bad_network(python: str) -> str:
    """Orders, moves and sticks through a network that loses, doubles and reorders."""
    async with served("127.0.2.7"):
        said = ""
        proxy = LossyProxy("127.0.2.8", "127.0.2.7", loss=Loss(), seed=0)
        async with proxy.running():
            said = await run(python, FAULTS / "hundred_settings.py", "127.0.2.8")
            for name in ("settings", "gimbal", "move_by", "piloting"):
                try:
                    await run(python, CLIENTS / f"{name}.py", "127.0.2.8")
                except FaultError as error:
                    raise FaultError(f"{name}: {error}") from error
        tally = proxy.tally
    return (
        f"{said}; settings, gimbal, move_by, piloting flew; of {tally.passed + tally.dropped} "
        f"datagrams {tally.dropped} dropped, {tally.doubled} doubled, {tally.late} late"
    )


CASES: dict[str, Callable[[str], Awaitable[str]]] = {
    case.__name__: case
    for case in (fifty_connections, three_drones, client_killed, drone_killed, bad_network)
}


async def suffer(python: str, names: list[str]) -> bool:
    """Go through the cases; print a line about each."""
    good = True
    for name in names:
        start = time.monotonic()
        try:
            verdict, said = "ok", await CASES[name](python)
        except (FaultError, TimeoutError) as error:
            verdict, said, good = "FAILED", str(error) or "it never ended", False
        print(f"{name:<20}{verdict:<8}{time.monotonic() - start:>6.1f} s  {said}", flush=True)
    return good


def main() -> None:
    """Run what was asked for; exit with 1 when something failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", required=True, help="of an environment with Olympe")
    parser.add_argument("--case", action="append", choices=CASES, help="only this one; repeatable")
    options = parser.parse_args()
    good = asyncio.run(suffer(options.python, options.case or list(CASES)))
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
