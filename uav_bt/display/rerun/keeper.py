"""Ends a program when the process that started it ends, however that ends.

    python -m uav_bt.display.rerun.keeper PROGRAM [ARGUMENT]...

What started it holds the other end of its standard input, and the system closes that.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Final

KEPT: Final = (sys.executable, "-m", "uav_bt.display.rerun.keeper")
"""What stands before a command that is to end with this process."""


def main(command: Sequence[str]) -> int:
    """Run a program until it ends, or the standard input does; return its exit code."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL)  # noqa: S603 - ours, see above

    def end() -> None:
        sys.stdin.buffer.read()
        process.terminate()

    threading.Thread(target=end, daemon=True).start()
    return process.wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
