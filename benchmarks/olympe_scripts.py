"""Loopback ANAFIs and Olympe scripts as processes, for the benchmarks that put them together."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import tempfile
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import IO

TIMEOUT_S = 240.0


class FaultError(Exception):
    """Something else happened than should."""


@asynccontextmanager
async def served(
    address: str, *options: str, python: str = sys.executable
) -> AsyncIterator[Process]:
    """Run a loopback ANAFI."""
    server = await asyncio.create_subprocess_exec(
        python, "-m", "uav_bt", "serve-anafi", "--address", address, *options, stdout=PIPE
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
    """An Olympe script in a separate process."""

    def __init__(self, process: Process, errors: IO[bytes]) -> None:
        self.process = process
        self._errors = errors

    @classmethod
    async def start(cls, python: str, path: Path, address: str, **env: str) -> Script:
        """Start it against the drone at an address; its folder is its working directory."""
        errors = tempfile.TemporaryFile()  # noqa: SIM115  (open as long as the script runs)
        process = await asyncio.create_subprocess_exec(
            python,
            str(path),
            env=os.environ | {"DRONE_IP": address} | env,
            cwd=path.parent,
            stdin=PIPE,
            stdout=PIPE,
            stderr=errors,
        )
        return cls(process, errors)

    async def prints(self, line: str) -> None:
        """Wait for a line."""
        assert self.process.stdout is not None  # noqa: S101  (asked for above)
        while found := await asyncio.wait_for(self.process.stdout.readline(), TIMEOUT_S):
            if found.decode().strip() == line:
                return
        raise FaultError(f"the script ended without printing {line!r}")

    async def go_on(self) -> None:
        """Press return."""
        assert self.process.stdin is not None  # noqa: S101  (asked for above)
        self.process.stdin.write(b"\n")
        await self.process.stdin.drain()

    async def ends(self) -> str:
        """Wait for its end; return its last line that is not of Olympe's log."""
        try:
            output, _ = await asyncio.wait_for(self.process.communicate(), TIMEOUT_S)
        except TimeoutError:
            self.process.kill()
            raise FaultError(f"the script did not end within {TIMEOUT_S:.0f} s") from None
        if self.process.returncode != 0:
            self._errors.seek(0)
            lines = self._errors.read().decode().strip().splitlines() or ["no message"]
            raise FaultError(f"the script ended with {self.process.returncode}: {lines[-1]}")
        lines = [line for line in output.decode().splitlines() if line and line[:2] != "20"]
        return lines[-1] if lines else ""


async def run(python: str, path: Path, address: str, **env: str) -> str:
    """Run a script to its end."""
    return await (await Script.start(python, path, address, **env)).ends()
