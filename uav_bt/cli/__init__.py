"""The command line: one thin module per command over `uav_bt.app` and `uav_bt.learning`."""

from __future__ import annotations

__all__ = ["main"]


def main() -> None:
    """Run `uav-bt`."""
    from uav_bt.cli.root import uav_bt  # noqa: PLC0415 - the package's face imports nothing

    uav_bt()
