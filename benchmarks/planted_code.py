"""Copies of the product's code, one for each planted defect, and the commands that run in them."""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.planted_edits import Defect
from uav_bt.errors import FileError
from uav_bt.files import write_whole

ROOT: Final = Path(__file__).resolve().parents[1]
_PACKAGES: Final = ("uav_bt", "behaviours", "perception", "sim_bridge", "trees")
_SOURCES: Final = frozenset({".py", ".xml", ".yaml"})
_DIGEST_FILE: Final = "sources.sha256"
_POLL_S: Final = 0.5
_STOP_S: Final = 10.0  # from SIGTERM to SIGKILL; a campaign ends within a second


@dataclass(frozen=True)
class Code:
    """A copy of the product's packages.

    Attributes:
        folder: The folder that holds them.
    """

    folder: Path

    @classmethod
    def copied(cls, source: Path, folder: Path, defect: Defect | None = None) -> Code:
        """Return a copy; one of the same code that is there already is used.

        Times of files and Numba's machine code beside the modules are copied, too, so that only
        the edited file is compiled again.

        Args:
            source: Folder with the packages.
            folder: Folder of the copy.
            defect: The defect that is planted in it; None: none.

        Raises:
            FileError: The defect's text does not occur exactly once, or the folder holds other
                code.
        """
        digest = _digest(source, defect)
        if folder.exists():
            kept = folder / _DIGEST_FILE
            if not kept.exists() or kept.read_text(encoding="utf-8") != digest:
                raise FileError(folder, "holds other code than today's; give a new folder to --out")
        else:
            part = folder.with_suffix(".part")
            shutil.rmtree(part, ignore_errors=True)
            for package in _PACKAGES:
                shutil.copytree(source / package, part / package)
            if defect is not None:
                defect.plant(part)
            write_whole(part / _DIGEST_FILE, digest)
            part.rename(folder)
        return cls(folder)

    def run(
        self,
        words: Sequence[str],
        log: Path,
        *,
        goes_on: Callable[[float], bool] = lambda _: True,
    ) -> int | None:
        """Run a `uav-bt` command with this code; return its exit code, None when it was stopped.

        Args:
            words: The command's words after `uav-bt`.
            log: File to which its output is appended.
            goes_on: Asked twice a second with the seconds since the beginning; False ends
                the command.
        """
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.folder),
            "PYTHONUNBUFFERED": "1",
        }
        began_s = time.monotonic()
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("a", encoding="utf-8") as output:
            process = subprocess.Popen(  # noqa: S603 - our own command
                [sys.executable, "-P", "-m", "uav_bt", *words],
                cwd=self.folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for this program, which then stops the command
            )
            try:
                while process.poll() is None:
                    if not goes_on(time.monotonic() - began_s):
                        return None
                    time.sleep(_POLL_S)
            finally:
                _stop(process)
        return process.returncode


def _digest(source: Path, defect: Defect | None) -> str:
    """Return the SHA-256 of the packages' sources and of the edit."""
    digest = hashlib.sha256(repr(defect).encode())
    files = (path for package in _PACKAGES for path in (source / package).rglob("*.*"))
    for path in sorted(path for path in files if path.suffix in _SOURCES):
        digest.update(str(path.relative_to(source)).encode() + path.read_bytes())
    return digest.hexdigest()


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a command that still runs, and kill it with its workers if it does not end itself."""
    if process.poll() is not None:
        return
    process.terminate()  # a background process may ignore SIGINT
    try:
        process.wait(_STOP_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
