"""The keys of the mission board. A plug-in adds its keys with its leaves."""

from __future__ import annotations

from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.board.numbers import NUMBER_KEYS
from uav_bt.protocols import Advice
from uav_bt.types import (
    CameraModel,
    ClassMap,
    Corridor,
    DepthMap,
    DroneState,
    Frame,
    HeldTurn,
    MarkFix,
    RecentViews,
)
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import SiteMap

# Greatest ages, seconds, for leaves and the arbiter's rules "stale frame", "link lost". Chosen.
_FRAME_S: Final = 0.7  # the time in which a step of 0.3 m starts
_STATE_S: Final = 0.7  # an ANAFI sends 5 samples a second: delayed by 0.1 s, with two lost
# The duration of a detour round a box, for which the tracker predicts a mark that is not detected.
# Then an approach ends and the search begins again.
_MARK_S: Final = 20.0

FRAME: Final = Key("frame", Frame, "newest camera frame", "", "runner", _FRAME_S)
STATE: Final = Key("state", DroneState, "newest telemetry", "", "runner", _STATE_S)
CAMERA: Final = Key("camera", CameraModel, "intrinsics at the frame's size", "", "runner")
ELAPSED: Final = Key("elapsed_s", float, "time since the take-off command", "s", "runner")
HEIGHT: Final = Key("height_above_ground_m", float, "height above the ground", "m", "runner")
CLASS_MAP: Final = Key("class_map", ClassMap, "class id of every pixel", "", "Segment", _FRAME_S)
RELATIVE_DEPTH: Final = Key(
    "relative_depth", DepthMap, "depth by the network, without unit", "", "EstimateDepth", _FRAME_S
)
METRIC_DEPTH: Final = Key(
    "metric_depth", DepthMap, "depth by the ground plane", "m", "EstimateDepth", _FRAME_S
)
CORRIDOR: Final = Key(
    "corridor", Corridor, "obstacles in the safety corridor", "", "BuildCorridor", _FRAME_S
)
MARK: Final = Key("mark", MarkFix, "where the landing mark lies", "", "FindMark", _MARK_S)
ODOMETRY: Final = Key(
    "odometry", MotionEstimate, "pose and velocity over the ground", "", "TrackMotion", _STATE_S
)
SITE_MAP: Final = Key(
    "site_map", SiteMap, "ground, obstacles, edges, objects, landing mark", "", "MapSite", _FRAME_S
)
PHASE: Final = Key(
    "phase",
    str,  # a `Phase`, or its value in scripts and records
    "phase of the mission, such as explore, or the name of a moving leaf that writes no phase",
    writer="mission leaves",
)
FLIGHT_HEIGHT: Final = Key(
    "flight_height_m", float, "height above the ground to fly at", "m", "the take-off"
)
RAISED: Final = Key(
    "raised_m", float, "height added among movers", "m", "leaves that give way", _STATE_S
)
FLIGHT_PITCH: Final = Key(
    "flight_pitch_rad", float, "the camera's pitch in flight, negative down", "rad", "the take-off"
)
HELD_TURN: Final = Key(
    "held_turn",
    HeldTurn,
    "the turn held since the last advance",
    writer="Explore, Avoid, ReturnToBase",
)
RECENT_VIEWS: Final = Key(
    "recent_views", RecentViews, "views of the last seconds", "", "RememberViews", _FRAME_S
)
ADVICE: Final = Key(
    "advice", Advice, "a policy's advice on the newest view", "", "Advise", _FRAME_S
)

_HERE: Final = tuple(value for value in tuple(globals().values()) if isinstance(value, Key))
MISSION_KEYS: Final[tuple[Key[Any], ...]] = (*_HERE, *NUMBER_KEYS)
