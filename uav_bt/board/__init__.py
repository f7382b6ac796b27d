"""The mission board: typed keys, ages, proposals, and what a leaf is handed."""

from uav_bt.board.blackboard import Blackboard, BoardView, Key, Reading
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import (
    ADVICE,
    CAMERA,
    CLASS_MAP,
    CORRIDOR,
    ELAPSED,
    FLIGHT_HEIGHT,
    FRAME,
    HEIGHT,
    HELD_TURN,
    HELIPAD,
    METRIC_DEPTH,
    MISSION_KEYS,
    OBSTACLES,
    PHASE,
    RECENT_VIEWS,
    RELATIVE_DEPTH,
    STATE,
)

__all__ = [
    "ADVICE",
    "CAMERA",
    "CLASS_MAP",
    "CORRIDOR",
    "ELAPSED",
    "FLIGHT_HEIGHT",
    "FRAME",
    "HEIGHT",
    "HELD_TURN",
    "HELIPAD",
    "METRIC_DEPTH",
    "MISSION_KEYS",
    "OBSTACLES",
    "PHASE",
    "RECENT_VIEWS",
    "RELATIVE_DEPTH",
    "STATE",
    "Blackboard",
    "BoardView",
    "Key",
    "MissionContext",
    "Reading",
]
