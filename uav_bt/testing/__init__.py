"""The test kit: a bench for leaves, a scripted drone, a clock moved by hand, a pytest plug-in."""

from uav_bt.clock import ManualClock
from uav_bt.testing.bench import LeafBench
from uav_bt.testing.drone import ScriptedDrone, ScriptedDroneConfig, blank_frame, pinhole

__all__ = [
    "LeafBench",
    "ManualClock",
    "ScriptedDrone",
    "ScriptedDroneConfig",
    "blank_frame",
    "pinhole",
]
