"""The test kit: benches, a scripted drone, faults, a manual clock, a pytest plug-in.

Names are imported on first use, because every pytest run on a machine with the package loads the
plug-in.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from uav_bt.clock import ManualClock
    from uav_bt.testing.bench import LeafBench
    from uav_bt.testing.board import BenchBoard, StrictBlackboard
    from uav_bt.testing.drone import ScriptedDrone, blank_frame, pinhole
    from uav_bt.testing.events import Event, EventLog
    from uav_bt.testing.faults import FAULTS, Fault, FaultKind, FaultyDrone, InjectedError
    from uav_bt.testing.maps import drawn_map
    from uav_bt.testing.tree_bench import TickOutcome, TreeBench, load_tree, parse_tree
    from uav_bt.testing.world import Says, live, show
    from uav_bt.tree.observer import NodeEvent
    from uav_bt.tree.scripted import Mock

__all__ = [
    "FAULTS",
    "BenchBoard",
    "Event",
    "EventLog",
    "Fault",
    "FaultKind",
    "FaultyDrone",
    "InjectedError",
    "LeafBench",
    "ManualClock",
    "Mock",
    "NodeEvent",
    "Says",
    "ScriptedDrone",
    "StrictBlackboard",
    "TickOutcome",
    "TreeBench",
    "blank_frame",
    "drawn_map",
    "live",
    "load_tree",
    "parse_tree",
    "pinhole",
    "show",
]

_MODULES: Final = ("bench", "board", "drone", "events", "faults", "maps", "tree_bench", "world")


def __getattr__(name: str) -> Any:
    if name in __all__:
        for module in _MODULES:
            home = importlib.import_module(f"{__name__}.{module}")
            if hasattr(home, name):
                return getattr(home, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
