"""The keys of the mission board. A plug-in adds its keys with its leaves."""

from __future__ import annotations

from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.clock import TIME_LIMIT_S
from uav_bt.protocols import Advice
from uav_bt.types import DroneState, HeldTurn, MarkFix, RecentViews, SiteMap
from uav_bt.types.camera import CameraModel, ClassMap, Corridor, DepthMap, Frame
from uav_bt.types.dead_reckoning import MotionEstimate

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
# A `Phase`, or its value in scripts and records
PHASE: Final = Key(
    "phase", str, "phase, such as explore, or a moving leaf without one", "", "mission leaves"
)
FLIGHT_HEIGHT: Final = Key(
    "flight_height_m", float, "height above the ground to fly at", "m", "the take-off"
)
RAISED: Final = Key(
    "raised_m", float, "height added among movers", "m", "avoiding leaves", _STATE_S
)
FLIGHT_PITCH: Final = Key(
    "flight_pitch_rad", float, "the camera's pitch in flight, negative down", "rad", "the take-off"
)
HELD_TURN: Final = Key(
    "held_turn", HeldTurn, "turn since the last advance", "", "Explore, Avoid, ReturnToBase"
)
RECENT_VIEWS: Final = Key(
    "recent_views", RecentViews, "views of the last seconds", "", "RememberViews", _FRAME_S
)
ADVICE: Final = Key("advice", Advice, "a policy's advice on the view", "", "Advise", _FRAME_S)

# --- the numbers of a mission, for scripts --------------------------------------------------------

UNKNOWN: Final = -1.0  # an unknown number that is never negative
UNKNOWN_PLACE: Final = 9999.0  # an unknown coordinate or heading

# The numbers of a dry run, unless its script gives others: without faults and progress.
QUIET: Final[dict[Key[Any], float]] = {}


def _number(name: str, quiet: float, doc: str, unit: str = "") -> Key[float]:
    key = Key(name, float, doc, unit, "runner")
    QUIET[key] = quiet
    return key


BATTERY_SHARE: Final = _number("battery_share", 1.0, "charge of the battery, 0 to 1; -1: unknown")
BATTERY_PER_MIN: Final = _number(
    "battery_per_min", UNKNOWN, "battery share that a minute of flight takes; -1: unknown"
)
LINK_SHARE: Final = _number("link_share", 1.0, "quality of the radio link, 0 to 1; -1: unknown")
FLYING: Final = _number("flying", 0.0, "1 from the take-off until the landing, else 0")
TIME_LEFT: Final = _number("time_left_s", TIME_LIMIT_S, "time until the mission's time limit", "s")
X: Final = _number("x_m", 0.0, "distance ahead of the take-off pose; 9999: unknown", "m")
Y: Final = _number("y_m", 0.0, "distance to the right of the take-off pose; 9999: unknown", "m")
HEADING: Final = _number(
    "heading_deg", 0.0, "clockwise from the take-off heading, -180 to 180; 9999: unknown", "deg"
)
HOME: Final = _number("home_m", 0.0, "straight distance to the take-off point; -1: unknown", "m")
MARK_KNOWN: Final = _number("mark_known", 0.0, "1 if the landing mark is tracked or mapped, else 0")
LOCALISED: Final = _number(
    "localised", 1.0, "1 while odometry follows the ground and views fit the map, else 0"
)
BLIND: Final = _number(
    "blind_s", 0.0, "time without a new frame, or ground in the map's views; -1: no frame", "s"
)
UNHEARD: Final = _number("unheard_s", 0.0, "time since the newest telemetry", "s")
COVERAGE_SHARE: Final = _number(
    "coverage_share", 0.0, "share of the map's ground within 0.5 m of the flown path; -1: no map"
)
OBJECTS_COUNT: Final = _number("objects_count", 0.0, "number of objects on the map; -1: no map")
PHOTOS_COUNT: Final = _number("photos_count", 0.0, "number of photographs that were stored")
AREA_MARGIN: Final = _number(
    "area_margin_m",
    UNKNOWN_PLACE,
    "distance to the boundary of the area of `Rules`, negative outside; 9999: no area; "
    "-9999: the place is unknown",
    "m",
)

MISSION_KEYS: Final = tuple(each for each in tuple(globals().values()) if isinstance(each, Key))
# Of `trees/lib/perceive.xml`.
PERCEIVED_KEYS: Final = (CLASS_MAP, MARK, ODOMETRY, SITE_MAP, METRIC_DEPTH, CORRIDOR)
