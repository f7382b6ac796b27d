"""Numbers that the runner writes to the board in every tick, for scripts and conditions.

They are never stale: a number that is not known has a value outside its range.
"""

from __future__ import annotations

from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.clock import TIME_LIMIT_S

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
    "battery_per_min",
    UNKNOWN,
    "share of the battery that a minute of this flight takes; -1: unknown",
)
LINK_SHARE: Final = _number("link_share", 1.0, "quality of the radio link, 0 to 1; -1: unknown")
FLYING: Final = _number("flying", 0.0, "1 from the take-off until the landing, else 0")
TIME_LEFT: Final = _number("time_left_s", TIME_LIMIT_S, "time until the mission's time limit", "s")
X: Final = _number("x_m", 0.0, "distance ahead of the take-off pose; 9999: unknown", "m")
Y: Final = _number("y_m", 0.0, "distance to the right of the take-off pose; 9999: unknown", "m")
HEADING: Final = _number(
    "heading_deg",
    0.0,
    "heading, clockwise from that of the take-off, -180 to 180; 9999: unknown",
    "deg",
)
HOME: Final = _number("home_m", 0.0, "straight distance to the take-off point; -1: unknown", "m")
MARK_KNOWN: Final = _number(
    "mark_known", 0.0, "1 when the landing mark is tracked or mapped, else 0"
)
LOCALISED: Final = _number(
    "localised",
    1.0,
    "1 while the odometry follows the ground and views agree with the map, else 0",
)
BLIND: Final = _number(
    "blind_s",
    0.0,
    "time without a new frame, or without ground in the map's views; -1: no frame",
    "s",
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

NUMBER_KEYS: Final = tuple(QUIET)
