"""Flights as lines of JSON, which a campaign writes and a report reads."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json, reading
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.mission.judge import Outcome

FlightKey = tuple[str, str | None, int]
"""Tree, scene and seed, which identify a flight of a campaign."""


_DIGITS: Final = {"s": 1, "m": 3, "%": 1, "": 2}  # decimal places by unit


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A number in a flight's line.

    Attributes:
        words: Its name in reports.
        unit: Its unit in reports: s, m or %. Empty: a count. In the line, a share is 0 to 1.
    """

    words: str
    unit: str = ""

    @property
    def digits(self) -> int:
        """Decimal places in reports."""
        return _DIGITS[self.unit]

    @property
    def title(self) -> str:
        """The name with the unit."""
        return f"{self.words}, {self.unit}" if self.unit else self.words


_FIRST: Final = f"in the first {EXPLORE_S:.0f} s"

METRICS: Final = {
    "duration_s": Metric(words="duration", unit="s"),
    "explore_distance_m": Metric(words=f"distance {_FIRST}", unit="m"),
    "total_distance_m": Metric(words="total distance", unit="m"),
    "search_distance_m": Metric(words="distance while searching", unit="m"),
    "time_to_find_mark_s": Metric(words="time to find the landing mark", unit="s"),
    "time_to_land_s": Metric(words="time from there to motors off", unit="s"),
    "landing_error_m": Metric(words="landing error", unit="m"),
    "min_clearance_m": Metric(words="least clearance of a flight", unit="m"),
    "coverage_passed_90s": Metric(words=f"free ground passed {_FIRST}", unit="%"),
    "coverage_passed": Metric(words="free ground passed", unit="%"),
    "coverage_seen_90s": Metric(words=f"free ground seen {_FIRST}", unit="%"),
    "coverage_seen": Metric(words="free ground seen", unit="%"),
    "objects_found": Metric(words="objects found by the map"),
    "false_objects": Metric(words="objects of the map that are not there"),
    "map_drift_90s_m": Metric(words="drift of the map after 90 s", unit="m"),
    "map_drift_180s_m": Metric(words="drift of the map after 180 s", unit="m"),
    "map_drift_m": Metric(words="drift of the map at the end", unit="m"),
}
"""Fields of a flight's line that hold a number, or null when the flight did not reach it."""

_OUTCOMES: Final = tuple(outcome.value for outcome in Outcome)
# Computing times, which differ from run to run.
_NOT_COMPARED: Final = frozenset({"tick_ms", "perception_ms", "slow_leaves", "wall_s"})
_COUNTS: Final = ("objects_total", "map_restarts")
_CURVES: Final = {"path": "t, x, y, z", "coverage_curve": "t, passed, seen"}
_TEXT_FIELDS: Final = ("reason", "lab", "drone", "record", "folder", "details", "profile")


@dataclass(frozen=True, kw_only=True)
class FlightLines:
    """Contents of a file of flights."""

    flights: tuple[dict[str, Any], ...]  # in the order in which they ended
    damaged: tuple[str, ...]  # `file:line: what is wrong`, of lines that were left out


def key_of(flight: Mapping[str, Any]) -> FlightKey:
    """Return the key that identifies a flight in its campaign."""
    return flight["tree"], flight["scene"], flight["seed"]


def file_stem(key: FlightKey) -> str:
    """Return the name of a flight's files, without its ending; two flights may have the same."""
    tree, scene, seed = key
    # A scene may be called anything.
    return re.sub(r"[^\w.-]+", "_", f"{Path(tree).stem}-{scene}-{seed}")


def comparable(flight: Mapping[str, Any]) -> dict[str, Any]:
    """Return a flight without what depends on the machine's speed.

    Two flights of one seed agree in all of this on one machine, whatever flew beside them.
    """
    return {name: value for name, value in flight.items() if name not in _NOT_COMPARED}


def parse_flight(text: bytes | str) -> dict[str, Any]:
    """Return the flight of a line.

    Raises:
        InputError: the line holds no flight; the message says why.
    """
    flight = parse_json(text)
    if not isinstance(flight, dict):
        raise InputError(f"expected a flight's JSON object, got {type(flight).__name__}")
    _check(flight)
    return flight


def _check(flight: dict[str, Any]) -> None:
    tree, scene, seed = flight.get("tree"), flight.get("scene"), flight.get("seed")
    if not isinstance(tree, str) or not (scene is None or isinstance(scene, str)):
        raise InputError("a flight needs 'tree' and 'scene', and they are texts")
    flight.setdefault("scene", None)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"a flight's 'seed' is a whole number from 0, got {seed!r}")
    if flight.get("outcome") not in _OUTCOMES:
        known = ", ".join(sorted(_OUTCOMES))
        raise InputError(f"unknown outcome {flight.get('outcome')!r} (known: {known})")
    _check_numbers(flight)
    _check_changes(flight)
    for name in _TEXT_FIELDS:
        if not isinstance(flight.get(name) or "", str):
            raise InputError(f"'{name}' must be a text, got {flight[name]!r}")


def _check_changes(flight: dict[str, Any]) -> None:
    movers = flight.get("movers") or 0
    if not isinstance(movers, int) or isinstance(movers, bool) or movers < 0:
        raise InputError(f"'movers' must be a whole number from 0, got {movers!r}")
    for name in ("vary_room", "on_mark"):
        if not isinstance(flight.get(name) or False, bool):
            raise InputError(f"'{name}' must be true or false, got {flight[name]!r}")
    faults = flight.get("faults") or []
    if not isinstance(faults, list) or not all(isinstance(fault, str) for fault in faults):
        raise InputError(f"'faults' must be a list of texts, got {faults!r}")
    for name in ("ports", "variables"):
        if not isinstance(flight.get(name) or {}, dict):
            raise InputError(f"'{name}' must hold values by name, got {flight[name]!r}")


def _check_numbers(flight: dict[str, Any]) -> None:
    for name in (*METRICS, *_COUNTS, "wall_s"):
        if not _is_number(flight.get(name, 0.0)):
            raise InputError(f"'{name}' must be a number or null, got {flight[name]!r}")
    errors = flight.get("object_errors_m") or []
    if not isinstance(errors, list) or None in errors or not all(map(_is_number, errors)):
        raise InputError("'object_errors_m' must be a list of numbers")
    stages = flight.get("perception_ms") or {}
    if not isinstance(stages, dict) or not all(map(_are_times, stages.values())):
        raise InputError("'perception_ms' must hold p50, p99 and max by stage")
    if not _are_times(flight.get("tick_ms")):
        raise InputError("'tick_ms' must hold p50, p99 and max")
    for name, columns in _CURVES.items():
        points = flight.get(name) or []
        size = len(columns.split(","))
        if not isinstance(points, list) or not all(_is_point(point, size) for point in points):
            raise InputError(f"'{name}' must be a list of [{columns}]")


def _is_number(value: Any) -> bool:
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value is None or (plain and math.isfinite(value))


def _are_times(value: Any) -> bool:
    return value is None or (
        isinstance(value, dict)
        and all(name in value and _is_number(value[name]) for name in ("p50", "p99", "max"))
        and None not in value.values()
    )


def _is_point(point: Any, size: int) -> bool:
    return (
        isinstance(point, list)
        and len(point) == size
        and all(value is not None and _is_number(value) for value in point)
    )


def read_flights(path: Path) -> FlightLines:
    """Read a file of flights; damaged lines are left out and named.

    A flight that the file has twice counts once: the later line.

    Raises:
        FileError: the file cannot be read.
    """
    with reading(path), path.open("rb") as file:
        return _parse_all(path, file)


def _parse_all(path: Path, lines: Iterable[bytes]) -> FlightLines:
    flights: dict[FlightKey, dict[str, Any]] = {}
    damaged: list[str] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            flight = parse_flight(line)
        except InputError as error:
            damaged.append(str(FileError(path, str(error), number)))
        else:
            flights.pop(key_of(flight), None)
            flights[key_of(flight)] = flight
    return FlightLines(flights=tuple(flights.values()), damaged=tuple(damaged))
