"""The test kit: benches, a scripted drone, faults, a manual clock, a pytest plug-in.

Names are imported on first use, because every pytest run on a machine with the package loads the
plug-in.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from uav_bt.clock import ManualClock
    from uav_bt.testing.bench import LeafBench, StrictBlackboard
    from uav_bt.testing.drone import ScriptedDrone, blank_frame, pinhole
    from uav_bt.testing.events import EventLog
    from uav_bt.testing.fault_kinds import FAULTS, FaultKind, InjectedError
    from uav_bt.testing.faults import Fault, FaultyDrone
    from uav_bt.testing.tree_bench import TreeBench, load_tree, parse_tree
    from uav_bt.testing.world import Says, drawn_map, live, show
    from uav_bt.tree.scripted import Mock

__all__ = [
    "FAULTS",
    "EventLog",
    "Fault",
    "FaultKind",
    "FaultyDrone",
    "InjectedError",
    "LeafBench",
    "ManualClock",
    "Mock",
    "Says",
    "ScriptedDrone",
    "StrictBlackboard",
    "TreeBench",
    "blank_frame",
    "drawn_map",
    "live",
    "load_tree",
    "parse_tree",
    "pinhole",
    "show",
]

_KIT: Final = (".bench", ".drone", ".events", ".fault_kinds", ".faults", ".tree_bench", ".world")
_MODULES: Final = (*_KIT, "uav_bt.tree.scripted")


def __getattr__(name: str) -> Any:
    if name in __all__:
        for module in _MODULES:
            home = importlib.import_module(module, __name__)
            if hasattr(home, name):
                return getattr(home, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
