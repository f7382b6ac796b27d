"""The test kit: a bench for leaves, a scripted drone, a clock moved by hand, a pytest plug-in.

Names are imported when they are first used: the plug-in is loaded by every pytest run on a machine
where the package is installed, and must cost nothing there.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
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

_HOMES: Final = {
    "LeafBench": "uav_bt.testing.bench",
    "ManualClock": "uav_bt.clock",
    "ScriptedDrone": "uav_bt.testing.drone",
    "ScriptedDroneConfig": "uav_bt.testing.drone",
    "blank_frame": "uav_bt.testing.drone",
    "pinhole": "uav_bt.testing.drone",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
