"""Dry runs of mission files: the tree is ticked, its leaves are scripted, nothing flies."""

from uav_bt.simulation.dry_run import Answer, SimulatedTick, Simulation, status_name
from uav_bt.simulation.script_file import SimulationScript, read_script

__all__ = [
    "Answer",
    "SimulatedTick",
    "Simulation",
    "SimulationScript",
    "read_script",
    "status_name",
]
