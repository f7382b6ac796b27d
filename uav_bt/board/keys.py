"""The keys of the mission board, in one place. A plug-in contributes its own when it registers."""

from __future__ import annotations

from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.protocols import Advice
from uav_bt.types import (
    CameraModel,
    ClassMap,
    Corridor,
    DepthMap,
    DroneState,
    Frame,
    HeldTurn,
    HelipadFix,
    RecentViews,
)
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import SiteMap

# A frame is old when the drone has flown blind for longer than one 30 cm step takes to start.
_FRAME_MAX_AGE_S = 0.7
# Telemetry comes many times a second; without it for half a second nothing is known.
_STATE_MAX_AGE_S = 0.5
# The tracker carries the pad through missed frames; afterwards the search begins again.
_HELIPAD_MAX_AGE_S = 22.0

FRAME: Final = Key(
    "frame", Frame, "newest camera frame", writer="runner", max_age_s=_FRAME_MAX_AGE_S
)
STATE: Final = Key(
    "state", DroneState, "newest telemetry", writer="runner", max_age_s=_STATE_MAX_AGE_S
)
CAMERA: Final = Key("camera", CameraModel, "intrinsics at the frame's size", writer="runner")
ELAPSED: Final = Key(
    "elapsed_s", float, "time since the take-off command", unit="s", writer="runner"
)
HEIGHT: Final = Key(
    "height_above_carpet_m", float, "height above the carpet", unit="m", writer="runner"
)
CLASS_MAP: Final = Key(
    "class_map",
    ClassMap,
    "class id of every pixel",
    writer="Segment",
    max_age_s=_FRAME_MAX_AGE_S,
)
RELATIVE_DEPTH: Final = Key(
    "relative_depth",
    DepthMap,
    "depth of every pixel as the network gives it, in no unit",
    writer="EstimateDepth",
    max_age_s=_FRAME_MAX_AGE_S,
)
METRIC_DEPTH: Final = Key(
    "metric_depth",
    DepthMap,
    "depth of every pixel, scaled by the ground plane",
    unit="m",
    writer="EstimateDepth",
    max_age_s=_FRAME_MAX_AGE_S,
)
CORRIDOR: Final = Key(
    "corridor",
    Corridor,
    "what stands in the five-plane safety corridor",
    writer="BuildCorridor",
    max_age_s=_FRAME_MAX_AGE_S,
)
HELIPAD: Final = Key(
    "helipad",
    HelipadFix,
    "where the helipad lies",
    writer="FindHelipad",
    max_age_s=_HELIPAD_MAX_AGE_S,
)

ODOMETRY: Final = Key(
    "odometry",
    MotionEstimate,
    "where the drone is and how it moves over the ground, as the ground shows it",
    writer="TrackMotion",
    max_age_s=_STATE_MAX_AGE_S,
)
SITE_MAP: Final = Key(
    "site_map",
    SiteMap,
    "the map of the place: ground, obstacles, edges, objects, landing mark, and what is near",
    writer="MapSite",
    max_age_s=_FRAME_MAX_AGE_S,
    formerly=("obstacles",),
)
PHASE: Final = Key(
    "phase",
    str,  # a `Phase`, or its value where text is all there is (scripts, records)
    "what the mission is doing: explore, search, approach, ...",
    writer="mission leaves",
)
FLIGHT_HEIGHT: Final = Key(
    "flight_height_m",
    float,
    "height above the carpet that the mission flies at",
    unit="m",
    writer="the take-off",
)
FLIGHT_PITCH: Final = Key(
    "flight_pitch_rad",
    float,
    "the camera's pitch in flight, negative down",
    unit="rad",
    writer="the take-off",
)

HELD_TURN: Final = Key(
    "held_turn",
    HeldTurn,
    "the turn held since the last advance",
    writer="Explore, Avoid, leaves of ReturnToBase",
)

RECENT_VIEWS: Final = Key(
    "recent_views",
    RecentViews,
    "frames of the last seconds, and where they were captured",
    writer="RememberViews",
    max_age_s=_FRAME_MAX_AGE_S,
)
ADVICE: Final = Key(
    "advice",
    Advice,
    "a policy's advice on the newest view",
    writer="Advise",
    max_age_s=_FRAME_MAX_AGE_S,
)

MISSION_KEYS: Final[tuple[Key[Any], ...]] = (
    FRAME,
    STATE,
    CAMERA,
    ELAPSED,
    HEIGHT,
    CLASS_MAP,
    RELATIVE_DEPTH,
    METRIC_DEPTH,
    CORRIDOR,
    HELIPAD,
    ODOMETRY,
    SITE_MAP,
    PHASE,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    HELD_TURN,
    RECENT_VIEWS,
    ADVICE,
)
