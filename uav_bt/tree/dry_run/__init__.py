"""Dry runs of mission files: the tree is ticked, its leaves are scripted, nothing flies."""

from uav_bt.tree.dry_run.script_file import SimulationScript, read_script
from uav_bt.tree.dry_run.simulation import Answer, SimulatedTick, Simulation

__all__ = [
    "Answer",
    "SimulatedTick",
    "Simulation",
    "SimulationScript",
    "read_script",
]
