"""The report of a flight: one JSON object."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from uav_bt.files import write_whole, writing
from uav_bt.types.flight_results import FlightEvent, FoundObject, Photo

# Span of `explore_distance_m`, seconds from the take-off command; chosen.
EXPLORE_S = 90.0


@dataclass(frozen=True, kw_only=True)
class Percentiles:
    """Milliseconds."""

    p50: float
    p99: float
    max: float

    @classmethod
    def of_seconds(cls, values_s: Sequence[float]) -> Percentiles | None:
        """Summarise durations, None without any."""
        if not values_s:
            return None
        ms = 1000.0 * np.asarray(values_s, dtype=np.float64)
        p50, p99, most = (round(float(each), 3) for each in np.percentile(ms, [50, 99, 100]))
        return cls(p50=p50, p99=p99, max=most)


@dataclass(frozen=True, kw_only=True)
class FlightChanges:
    """Changes for this flight only, besides the files that it names."""

    ports: dict[str, str] = field(default_factory=dict)  # values by NODE.PORT
    variables: dict[str, bool | int | float | str] = field(default_factory=dict)  # first values
    movers: int = 0  # random ones that were added to the scene
    vary_room: bool = False  # whether the boxes stand elsewhere than in the scene
    faults: list[str] = field(default_factory=list)  # of the drone


@dataclass(frozen=True, kw_only=True)
class FlightReport(FlightChanges):
    """One flight. None stands for a value that does not apply or was not reached."""

    scene: str | None
    lab: str | None = None  # name of the lab that was flown in; None: unknown
    seed: int
    tree: str
    policies: dict[str, str]  # by node
    drone: str
    profile: str | None
    outcome: str
    reason: str
    duration_s: float | None  # from the take-off command
    explore_distance_m: float | None  # the first 90 s after take-off; None without exploring
    total_distance_m: float | None
    search_distance_m: float | None  # from the end of exploration until the mark is found
    time_to_find_mark_s: float | None  # over the same span
    time_to_land_s: float | None  # from there until motors off
    landing_error_m: float | None  # horizontal, body centre to pad centre
    on_mark: bool | None = None  # stands above the mark; None: in the air, no mark, or unknown
    min_clearance_m: float | None  # from the hull to the nearest box or mover
    # Shares of the free ground, 0 to 1, 90 s after the take-off command and at the
    # end: within 0.5 m of the flown path, and in view within 3 m.
    coverage_passed_90s: float | None = None
    coverage_passed: float | None = None
    coverage_seen_90s: float | None = None
    coverage_seen: float | None = None
    coverage_curve: list[list[float]] = field(default_factory=list)  # [t, passed, seen] every 10 s
    # Agreement of the mission's map with the truth; None without a map or a referee.
    objects_found: int | None = None  # true objects that the map has within 0.5 m
    objects_total: int | None = None  # number of true objects
    object_errors_m: list[float] | None = None  # position errors of the found objects
    object_height_errors_m: list[float] | None = None  # of those with a height; high is positive
    false_objects: int | None = None  # objects on the map without a true one
    # Distance from the drone's true position to its position on the map, aligned at the take-off:
    # 90 s and 180 s after the take-off command, and at the end.
    map_drift_90s_m: float | None = None
    map_drift_180s_m: float | None = None
    map_drift_m: float | None = None
    map_restarts: int | None = None  # number of times that the mission began its map again
    # Objects of the map at the end, with their positions in the map's frame; None without a map.
    objects: list[FoundObject] | None = None
    photos: list[Photo] = field(default_factory=list)
    events: list[FlightEvent] = field(default_factory=list)
    ticks: int
    tick_ms: Percentiles | None
    perception_ms: dict[str, Percentiles | None] = field(default_factory=dict)
    # Leaves that blocked longer than their budget, by path: the longest time, milliseconds.
    slow_leaves: dict[str, float] = field(default_factory=dict)
    # Faults of the drone's motion or of the map that did not end the mission.
    warnings: list[str] = field(default_factory=list)
    # Whether the drone may still have been in the air when the program ended.
    airborne_at_end: bool = False
    # Displays and records that failed during the flight, with the reason.
    lost_outputs: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values."""
        return asdict(self)

    def __str__(self) -> str:
        """Return a line for each value that is not None."""
        return "\n".join(f"{name}: {value}" for name, value in self._reached())

    def _repr_html_(self) -> str:
        """Return the table that a notebook shows."""
        rows = (
            f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>"
            for name, value in self._reached()
        )
        return f"<table>{''.join(rows)}</table>"

    def _reached(self) -> Iterator[tuple[str, object]]:
        first = ("outcome", "reason")
        curves = ("coverage_curve", "events", "objects", "photos")  # for programs
        rest = (each.name for each in fields(FlightReport) if each.name not in first + curves)
        for name in (*first, *rest):
            value = getattr(self, name)
            if value not in (None, {}, []):
                yield name, value


def write_report(report: FlightReport, path: Path, *, new_folders: bool = False) -> None:
    """Write a report as JSON, for `new_folders` in a new folder; a reader never sees half of it.

    Raises:
        FileError: the file cannot be written.
    """
    with writing(path):
        if new_folders:
            path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(report.to_json(), indent=2) + "\n")
