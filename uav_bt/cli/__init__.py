"""The command line: a module for each group or large command."""

from uav_bt.cli.root import uav_bt as main

__all__ = ["main"]
