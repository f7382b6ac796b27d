"""The mission board: typed keys, ages, proposals, and the context of leaves."""

from typing import TYPE_CHECKING, Never

from uav_bt.board.blackboard import Blackboard, BoardView, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import (
    ADVICE,
    CAMERA,
    CLASS_MAP,
    CORRIDOR,
    ELAPSED,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    FRAME,
    HEIGHT,
    HELD_TURN,
    MARK,
    METRIC_DEPTH,
    MISSION_KEYS,
    ODOMETRY,
    PHASE,
    RAISED,
    RECENT_VIEWS,
    RELATIVE_DEPTH,
    SITE_MAP,
    STATE,
)

__all__ = [
    "ADVICE",
    "CAMERA",
    "CLASS_MAP",
    "CORRIDOR",
    "ELAPSED",
    "FLIGHT_HEIGHT",
    "FLIGHT_PITCH",
    "FRAME",
    "HEIGHT",
    "HELD_TURN",
    "MARK",
    "METRIC_DEPTH",
    "MISSION_KEYS",
    "ODOMETRY",
    "PHASE",
    "RAISED",
    "RECENT_VIEWS",
    "RELATIVE_DEPTH",
    "SITE_MAP",
    "STATE",
    "Blackboard",
    "BoardView",
    "Key",
    "MissionContext",
    "Reading",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Never:
        if name == "OBSTACLES":
            # An AttributeError would lose its text in `from uav_bt.board import OBSTACLES`.
            raise ImportError("the board has no OBSTACLES any more: read SITE_MAP and its `near`")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
