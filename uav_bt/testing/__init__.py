"""The test kit: benches for leaves and trees, a scripted drone, a hand clock, a pytest plug-in.

Names are imported when they are first used: the plug-in is loaded by every pytest run on a machine
where the package is installed, and must cost nothing there.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from uav_bt.clock import ManualClock
    from uav_bt.testing.bench import LeafBench
    from uav_bt.testing.board import BenchBoard, StrictBlackboard
    from uav_bt.testing.drone import ScriptedDrone, ScriptedDroneConfig, blank_frame, pinhole
    from uav_bt.testing.events import Event, EventLog
    from uav_bt.testing.tree_bench import TickOutcome, TreeBench, load_tree, parse_tree
    from uav_bt.tree.observer import NodeEvent

__all__ = [
    "BenchBoard",
    "Event",
    "EventLog",
    "LeafBench",
    "ManualClock",
    "NodeEvent",
    "ScriptedDrone",
    "ScriptedDroneConfig",
    "StrictBlackboard",
    "TickOutcome",
    "TreeBench",
    "blank_frame",
    "load_tree",
    "parse_tree",
    "pinhole",
]

_HOMES: Final = {
    "BenchBoard": "uav_bt.testing.board",
    "Event": "uav_bt.testing.events",
    "EventLog": "uav_bt.testing.events",
    "NodeEvent": "uav_bt.tree.observer",
    "LeafBench": "uav_bt.testing.bench",
    "ManualClock": "uav_bt.clock",
    "ScriptedDrone": "uav_bt.testing.drone",
    "ScriptedDroneConfig": "uav_bt.testing.drone",
    "StrictBlackboard": "uav_bt.testing.board",
    "TickOutcome": "uav_bt.testing.tree_bench",
    "TreeBench": "uav_bt.testing.tree_bench",
    "blank_frame": "uav_bt.testing.drone",
    "load_tree": "uav_bt.testing.tree_bench",
    "parse_tree": "uav_bt.testing.tree_bench",
    "pinhole": "uav_bt.testing.drone",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
