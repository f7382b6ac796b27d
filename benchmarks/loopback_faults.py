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
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from lossy_proxy import Loss, LossyProxy
from olympe_scripts import FaultError, Script, run, served

HERE = Path(__file__).parent
CLIENTS, FAULTS = HERE / "olympe_clients", HERE / "olympe_faults"


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
        await script.prints("flying")
        script.process.kill()
        await script.process.wait()
        note = await run(python, FAULTS / "lands_it.py", "127.0.2.5")
        if server.returncode is not None:
            raise FaultError("the server died")
    return note


async def drone_killed(python: str) -> str:
    """A client whose drone dies notices it, and finds the next one."""
    async with served("127.0.2.6") as server:
        script = await Script.start(python, FAULTS / "is_left.py", "127.0.2.6")
        await script.prints("flying")
        server.kill()
        await server.wait()
    await script.go_on()
    await script.prints("left")
    async with served("127.0.2.6"):
        await script.go_on()
        return await script.ends()


async def bad_network(python: str) -> str:
    """Orders, moves and sticks through a network that loses, doubles and reorders."""
    async with served("127.0.2.7"):
        note = ""
        proxy = LossyProxy("127.0.2.8", "127.0.2.7", loss=Loss(), seed=0)
        async with proxy.running():
            note = await run(python, FAULTS / "hundred_settings.py", "127.0.2.8")
            for name in ("settings", "gimbal", "move_by", "piloting"):
                try:
                    await run(python, CLIENTS / f"{name}.py", "127.0.2.8")
                except FaultError as error:
                    raise FaultError(f"{name}: {error}") from error
        tally = proxy.tally
    return (
        f"{note}; settings, gimbal, move_by, piloting flew; of {tally.passed + tally.dropped} "
        f"datagrams {tally.dropped} dropped, {tally.doubled} doubled, {tally.late} late"
    )


CASES: dict[str, Callable[[str], Awaitable[str]]] = {
    case.__name__: case
    for case in (fifty_connections, three_drones, client_killed, drone_killed, bad_network)
}


async def run_cases(python: str, names: list[str]) -> bool:
    """Run the cases; print a line about each."""
    good = True
    for name in names:
        start = time.monotonic()
        try:
            verdict, note = "ok", await CASES[name](python)
        except (FaultError, TimeoutError) as error:
            verdict, note, good = "FAILED", str(error) or "it did not end", False
        print(f"{name:<20}{verdict:<8}{time.monotonic() - start:>6.1f} s  {note}", flush=True)
    return good


def main() -> None:
    """Run the faults; exit with 1 when one failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", required=True, help="of an environment with Olympe")
    parser.add_argument("--case", action="append", choices=CASES, help="only this one; repeatable")
    options = parser.parse_args()
    good = asyncio.run(run_cases(options.python, options.case or list(CASES)))
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
