"""Numbers that the runner writes to the board in every tick, for scripts and conditions.

They are never stale: a number that is not known has a value outside its range.
"""

from __future__ import annotations

from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.clock import TIME_LIMIT_S

UNKNOWN: Final = -1.0  # an unknown number that is never negative
UNKNOWN_PLACE: Final = 9999.0  # an unknown coordinate or heading


def _number(name: str, doc: str, unit: str = "") -> Key[float]:
    return Key(name, float, doc, unit, "runner")


BATTERY_SHARE: Final = _number("battery_share", "charge of the battery, 0 to 1; -1: unknown")
BATTERY_PER_MIN: Final = _number(
    "battery_per_min", "share of the battery that a minute of this flight takes; -1: unknown"
)
LINK_SHARE: Final = _number("link_share", "quality of the radio link, 0 to 1; -1: unknown")
FLYING: Final = _number("flying", "1 from the take-off until the landing, else 0")
TIME_LEFT: Final = _number("time_left_s", "time until the mission's time limit", "s")
X: Final = _number("x_m", "distance ahead of the take-off pose; 9999: unknown", "m")
Y: Final = _number("y_m", "distance to the right of the take-off pose; 9999: unknown", "m")
HEADING: Final = _number(
    "heading_deg",
    "heading, clockwise from that of the take-off, -180 to 180; 9999: unknown",
    "deg",
)
HOME: Final = _number("home_m", "straight distance to the take-off point; -1: unknown", "m")
MARK_KNOWN: Final = _number("mark_known", "1 when the landing mark is tracked or mapped, else 0")
LOCALISED: Final = _number(
    "localised", "1 while the odometry follows the ground and views agree with the map, else 0"
)
BLIND: Final = _number(
    "blind_s", "time without a new frame, or without ground in the map's views; -1: no frame", "s"
)
UNHEARD: Final = _number("unheard_s", "time since the newest telemetry", "s")
COVERAGE_SHARE: Final = _number(
    "coverage_share", "share of the map's ground within 0.5 m of the flown path; -1: no map"
)
OBJECTS_COUNT: Final = _number("objects_count", "number of objects on the map; -1: no map")
PHOTOS_COUNT: Final = _number("photos_count", "number of photographs that were stored")
AREA_MARGIN: Final = _number(
    "area_margin_m",
    "distance to the boundary of the area of `Rules`, negative outside; 9999: no area; "
    "-9999: the place is unknown",
    "m",
)

# The numbers of a dry run, unless its script gives others: without faults and progress.
QUIET: Final[tuple[tuple[Key[float], float], ...]] = (
    (BATTERY_SHARE, 1.0),
    (BATTERY_PER_MIN, UNKNOWN),
    (LINK_SHARE, 1.0),
    (FLYING, 0.0),
    (TIME_LEFT, TIME_LIMIT_S),
    (X, 0.0),
    (Y, 0.0),
    (HEADING, 0.0),
    (HOME, 0.0),
    (MARK_KNOWN, 0.0),
    (LOCALISED, 1.0),
    (BLIND, 0.0),
    (UNHEARD, 0.0),
    (COVERAGE_SHARE, 0.0),
    (OBJECTS_COUNT, 0.0),
    (PHOTOS_COUNT, 0.0),
    (AREA_MARGIN, UNKNOWN_PLACE),
)

NUMBER_KEYS: Final[tuple[Key[Any], ...]] = tuple(key for key, _ in QUIET)
