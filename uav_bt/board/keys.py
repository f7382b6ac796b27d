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

# Greatest age of a frame, seconds, for leaves and for the arbiter's rule "stale frame". Chosen: the
# time in which a step of 0.3 m starts.
_FRAME_MAX_AGE_S = 0.7
# Greatest age of telemetry, seconds, for leaves and for the arbiter's rule "link lost". Chosen: an
# ANAFI sends 5 samples a second; with a delay of 0.1 s and two lost samples one is 0.7 s old.
_STATE_MAX_AGE_S = 0.7
# Without a detection the tracker predicts the pad for the duration of a detour round a box. Then an
# approach ends and the search begins again. Chosen.
_MARK_MAX_AGE_S = 20.0

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
    "height_above_ground_m",
    float,
    "height above the ground",
    unit="m",
    writer="runner",
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
    "depth of every pixel as the network gives it, without unit",
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
    "obstacles in the five-plane safety corridor",
    writer="BuildCorridor",
    max_age_s=_FRAME_MAX_AGE_S,
)
MARK: Final = Key(
    "mark",
    MarkFix,
    "where the landing mark lies",
    writer="FindMark",
    max_age_s=_MARK_MAX_AGE_S,
)

ODOMETRY: Final = Key(
    "odometry",
    MotionEstimate,
    "pose and velocity of the drone over the ground",
    writer="TrackMotion",
    max_age_s=_STATE_MAX_AGE_S,
)
SITE_MAP: Final = Key(
    "site_map",
    SiteMap,
    "map of the site: ground, obstacles, edges, objects, landing mark, obstacles near the drone",
    writer="MapSite",
    max_age_s=_FRAME_MAX_AGE_S,
)
PHASE: Final = Key(
    "phase",
    str,  # a `Phase`, or its value in scripts and records
    "phase of the mission, such as explore, or the name of a moving leaf that writes no phase",
    writer="mission leaves",
)
FLIGHT_HEIGHT: Final = Key(
    "flight_height_m",
    float,
    "height above the ground that the mission flies at",
    unit="m",
    writer="the take-off",
)
RAISED: Final = Key(
    "raised_m",
    float,
    "height above the flight height that the drone keeps among movers",
    unit="m",
    writer="leaves that give way",
    max_age_s=_STATE_MAX_AGE_S,
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
    "frames of the last seconds, and the poses of their capture",
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
    MARK,
    ODOMETRY,
    SITE_MAP,
    PHASE,
    FLIGHT_HEIGHT,
    RAISED,
    FLIGHT_PITCH,
    HELD_TURN,
    RECENT_VIEWS,
    ADVICE,
    *NUMBER_KEYS,
)
