"""Trees watched while they fly: Groot2's live protocol and its log files.

Names are imported when they are first used, so that a flight that nobody watches loads none of it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from uav_bt.groot.btlog import BtlogReader, BtlogWriter
    from uav_bt.groot.groot_publisher import GrootConfig, GrootPublisher
    from uav_bt.groot.numbering import TreeNumbering
    from uav_bt.groot.recorder import TransitionRecorder
    from uav_bt.groot.transitions import Transition
    from uav_bt.groot.watch import TreeWatch, watched_live

__all__ = [
    "BtlogReader",
    "BtlogWriter",
    "GrootConfig",
    "GrootPublisher",
    "Transition",
    "TransitionRecorder",
    "TreeNumbering",
    "TreeWatch",
    "watched_live",
]

_HOMES: Final = {
    "BtlogReader": "uav_bt.groot.btlog",
    "BtlogWriter": "uav_bt.groot.btlog",
    "GrootConfig": "uav_bt.groot.groot_publisher",
    "GrootPublisher": "uav_bt.groot.groot_publisher",
    "Transition": "uav_bt.groot.transitions",
    "TransitionRecorder": "uav_bt.groot.recorder",
    "TreeNumbering": "uav_bt.groot.numbering",
    "TreeWatch": "uav_bt.groot.watch",
    "watched_live": "uav_bt.groot.watch",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
