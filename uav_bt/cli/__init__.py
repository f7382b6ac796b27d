"""The command line: a module for each group or large command."""

from uav_bt.cli.interrupts import end_at_once

__all__ = ["main"]


def main() -> None:
    """Run `uav-bt` with the arguments of this process, and exit."""
    end_at_once()
    from uav_bt.cli.root import uav_bt  # noqa: PLC0415  (after the signals are seen to)

    try:
        uav_bt()
    finally:
        end_at_once()  # only the interpreter's exit is left
