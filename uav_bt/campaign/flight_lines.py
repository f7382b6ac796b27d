"""Flights as lines of JSON, which a campaign writes and a report reads."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from pydantic import ConfigDict, NonNegativeInt, ValidationError, create_model

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json, reading
from uav_bt.mission.flight_report import EXPLORE_S, Percentiles
from uav_bt.mission.judge import Outcome

FlightKey = tuple[str, str | None, int]
"""Tree, scene and seed, which identify a flight of a campaign."""


class Metric(NamedTuple):
    """A number in a flight's line."""

    words: str  # its name in reports
    unit: str = ""  # in reports: s, m or %; empty: a count. In the line a share is 0 to 1


_FIRST: Final = f"in the first {EXPLORE_S:.0f} s"

METRICS: Final = {
    "duration_s": Metric("duration", "s"),
    "explore_distance_m": Metric(f"distance {_FIRST}", "m"),
    "total_distance_m": Metric("total distance", "m"),
    "search_distance_m": Metric("distance while searching", "m"),
    "time_to_find_mark_s": Metric("time to find the landing mark", "s"),
    "time_to_land_s": Metric("time from there to motors off", "s"),
    "landing_error_m": Metric("landing error", "m"),
    "min_clearance_m": Metric("least clearance of a flight", "m"),
    "coverage_passed_90s": Metric(f"free ground passed {_FIRST}", "%"),
    "coverage_passed": Metric("free ground passed", "%"),
    "coverage_seen_90s": Metric(f"free ground seen {_FIRST}", "%"),
    "coverage_seen": Metric("free ground seen", "%"),
    "objects_found": Metric("objects found by the map"),
    "false_objects": Metric("objects of the map that are not there"),
    "map_drift_90s_m": Metric("drift of the map after 90 s", "m"),
    "map_drift_180s_m": Metric("drift of the map after 180 s", "m"),
    "map_drift_m": Metric("drift of the map at the end", "m"),
}
"""Fields of a flight's line that hold a number, or null when the flight did not reach it."""

_NUMBERS: Final = (*METRICS, "objects_total", "map_restarts", "wall_s")
_TEXTS: Final = ("reason", "lab", "drone", "record", "folder", "details", "profile")
_OPTIONAL: Final[dict[str, Any]] = {
    **dict.fromkeys(_NUMBERS, float),
    **dict.fromkeys(_TEXTS, str),
    "movers": NonNegativeInt,
    "vary_room": bool,
    "on_mark": bool,
    "faults": list[str],
    "ports": dict[str, Any],
    "variables": dict[str, Any],
    "object_errors_m": list[float],
    "tick_ms": Percentiles,
    "perception_ms": dict[str, Percentiles | None],
    "path": list[tuple[float, float, float, float]],  # t, x, y, z
    "coverage_curve": list[tuple[float, float, float]],  # t, passed, seen
}
_LINE: Final = create_model(  # type: ignore[call-overload]
    "FlightLine",
    __config__=ConfigDict(strict=True, allow_inf_nan=False),
    tree=str,
    scene=(str | None, None),
    seed=NonNegativeInt,
    outcome=Outcome,
    **{name: (kind | None, None) for name, kind in _OPTIONAL.items()},
)
"""What the program reads of a line. A file may come from other programs, or be edited."""


def key_of(flight: Mapping[str, Any]) -> FlightKey:
    """Return the key that identifies a flight in its campaign."""
    return flight["tree"], flight["scene"], flight["seed"]


def file_stem(key: FlightKey) -> str:
    """Return the name of a flight's files, without its ending; two flights may have the same."""
    tree, scene, seed = key
    # A scene may be called anything.
    return re.sub(r"[^\w.-]+", "_", f"{Path(tree).stem}-{scene}-{seed}")


def parse_flight(text: bytes | str) -> dict[str, Any]:
    """Return the flight of a line; an InputError says why it holds none."""
    flight = parse_json(text)
    if not isinstance(flight, dict):
        raise InputError(f"expected a flight's JSON object, got {type(flight).__name__}")
    try:
        _LINE.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(
            f"no flight: '{where}': {first['msg']}, got {first['input']!r:.60}"
        ) from error
    flight.setdefault("scene", None)
    return flight


def read_flights(path: Path) -> tuple[dict[str, Any], ...]:
    """Return the flights of a file in their order; of a flight that it has twice the later line.

    Raises:
        FileError: the file cannot be read, or a line holds no flight.
    """
    flights: dict[FlightKey, dict[str, Any]] = {}
    with reading(path), path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.strip():
                continue
            try:
                flight = parse_flight(line)
            except InputError as error:
                remedy = "delete this line; a campaign flies its flight again"
                raise FileError(path, f"{error}; {remedy}", number) from error
            flights.pop(key_of(flight), None)
            flights[key_of(flight)] = flight
    return tuple(flights.values())
