"""Runs a program and ends it when the parent process ends for any reason.

    python -m uav_bt.display.rerun.keeper PROGRAM [ARGUMENT]...

The parent holds the other end of the standard input; the system closes it when the parent ends.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Final

KEPT: Final = (sys.executable, "-m", "uav_bt.display.rerun.keeper")
"""Prefix of a command that must end together with this process."""


def main(command: Sequence[str]) -> int:
    """Run a program until it or the standard input ends; return its exit code."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL)  # noqa: S603 - given by the caller

    def end() -> None:
        sys.stdin.buffer.read()
        process.terminate()

    threading.Thread(target=end, daemon=True).start()
    return process.wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
