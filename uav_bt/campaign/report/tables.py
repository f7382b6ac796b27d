"""Tables of a report. A new column is a heading and, in its row, a value."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from uav_bt.campaign.plan import flattened
from uav_bt.campaign.report import statistics as stats
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.store import METRICS
from uav_bt.mission.covered_ground import PASSED_M, SEEN_M
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.mission.judge import Outcome
from uav_bt.mission.map_check import FOUND_M

Row = Sequence[str | int | float | None]


class Table(NamedTuple):
    """A table of the report, as in its CSV file; one without rows is not on the page."""

    name: str  # of its CSV file, without the report's stem and the suffix
    title: str
    columns: Sequence[str]
    rows: Sequence[Row]
    note: str = ""

    def to_csv(self) -> str:
        """Return the table as CSV (RFC 4180, a header line)."""
        out = io.StringIO()
        csv.writer(out).writerows([self.columns, *self.rows])
        return out.getvalue()


def tables_of(sets: Sequence[FlightSet], page: Path) -> dict[str, Table]:
    """Return the report's tables by name, but for pairs; links are relative to the page."""
    makers = (_outcomes, _scenes, _metrics, _rates, _timings, _flights, _maps)
    tables = [*(make(sets) for make in makers), _failures(sets, page)]
    return {table.name: table for table in tables}


_SUCCESS: Final = ("flights", "successes", "success, %", "from, %", "to, %")


def _success(flights: Flights) -> Row:
    percent, ends = stats.success_percent(flights), stats.success_interval(flights)
    share = None if percent is None else round(percent, 1)
    return len(flights), stats.successes(flights), share, *(round(end, 1) for end in ends)


def _outcomes(sets: Sequence[FlightSet]) -> Table:
    failures = [outcome.value for outcome in Outcome if outcome.value != stats.SUCCESS]
    rows = []
    for one in sets:
        ends = [flight["outcome"] for flight in one.flights]
        rows.append([one.label, *_success(one.flights), *map(ends.count, failures)])
    columns = ("tree", *_SUCCESS, *(failure.replace("_", " ") for failure in failures))
    note = "From and to: the 95 % Wilson interval of the share of successes."
    return Table("outcomes", "Outcomes", columns, rows, note)


def _scenes(sets: Sequence[FlightSet]) -> Table:
    rows: list[Row] = []
    for one in sets:
        for scene in sorted({flight["scene"] for flight in one.flights if flight["scene"]}):
            flown = [flight for flight in one.flights if flight["scene"] == scene]
            rows.append([one.label, scene, *_success(flown)])
    return Table("scenes", "By scene", ("tree", "scene", *_SUCCESS), rows)


_METRIC_NOTE: Final = (
    f"Flights: those that reached the metric. The first {EXPLORE_S:.0f} s begin with the "
    "take-off command; shorter flights do not count. The search lasts from the end of "
    f"exploration until the mark is found. Passed: within {PASSED_M:g} m of the path. Seen: in "
    f"view, within {SEEN_M:g} m of the lens. Least clearance: of the hull from a box or mover."
)


def _metrics(sets: Sequence[FlightSet]) -> Table:
    rows: list[Row] = []
    for name, metric in METRICS.items():
        for one in sets:
            if values := stats.values_of(one.flights, name):
                numbers = (stats.rounded(each, name) for each in stats.spread(values).values())
                rows.append([name, metric.unit or None, one.label, len(values), *numbers])
    columns = ("metric", "unit", "tree", "flights", *stats.spread(()))
    return Table("metrics", "Times and distances", columns, rows, _METRIC_NOTE)


_EVENTS: Final = ("contacts", "exits", "landings elsewhere")


def _events(flight: Mapping[str, Any]) -> tuple[bool, ...]:
    """Return which of `_EVENTS` a flight had; the first violation ends it."""
    outcome = Outcome(flight["outcome"])
    stopped = outcome in {Outcome.ABORTED, Outcome.TIMEOUT}
    elsewhere = stopped and flight.get("on_mark") is False
    return outcome is Outcome.COLLISION, outcome is Outcome.LEFT_AREA, elsewhere


_RATE_H: Final = 100.0  # hours that rates are given for


def _rates(sets: Sequence[FlightSet]) -> Table:
    rows: list[Row] = []
    for one in sets:
        seconds, path_m, rooms = (
            sum(flight.get(name) or 0.0 for flight in one.flights)
            for name in ("duration_s", "total_distance_m", "coverage_passed")
        )
        if hours := seconds / 3600.0:
            row = [one.label, round(hours, 2), round(path_m / hours), round(rooms / hours, 1)]
            for count in np.sum([_events(flight) for flight in one.flights], axis=0).tolist():
                rates = (count / hours, *stats.rate_interval(count, hours))
                row += [count, *(round(_RATE_H * rate, 1) for rate in rates)]
            rows.append(row)
    numbers = ("", ", rate", ", from", ", to")
    events = [f"{event}{number}" for event in _EVENTS for number in numbers]
    columns = ("tree", "hours", "metres per hour", "rooms covered per hour", *events)
    note = (
        "From and to: the exact 95 % interval of the rate; without an event its upper end. A "
        "drone that hovers touches nothing, so distance and ground covered are beside."
    )
    return Table("rates", f"Events per {_RATE_H:.0f} hours", columns, rows, note)


def _sorted(one: FlightSet) -> Flights:
    return sorted(one.flights, key=lambda flight: (str(flight["scene"]), flight["seed"]))


def _failures(sets: Sequence[FlightSet], page: Path) -> Table:
    rows: list[Row] = []
    for one in sets:
        for flight in (each for each in _sorted(one) if each["outcome"] != stats.SUCCESS):
            outcome, command = flight["outcome"].replace("_", " "), one.repeat_command(flight)
            row = [one.label, flight["scene"], flight["seed"], outcome, flight.get("reason")]
            rows.append([*row, flight.get("duration_s"), _record(one, flight, page), command])
    columns = ("tree", "scene", "seed", "outcome", "reason", "after, s", "record")
    return Table("failures", "Every failure", (*columns, "command to repeat"), rows)


def _record(one: FlightSet, flight: Mapping[str, Any], page: Path) -> str | None:
    """Return the path of a flight's record from the page's folder, None without a record."""
    folder = one.path if one.path.is_dir() else one.path.parent
    file = folder / (flight.get("record") or "")
    return os.path.relpath(file.resolve(), page.resolve().parent) if file.is_file() else None


def _timings(sets: Sequence[FlightSet]) -> Table:
    rows = [[one.label, *row] for one in sets for row in _timings_of(one.flights)]
    columns = ("tree", "stage", "flights", "p50, ms", "p99, ms", "longest, ms", "times real time")
    note = (
        "p50 and p99: medians over the flights of each flight's percentiles. Longest: of all "
        "flights. One inference thread; other flights ran at the same time."
    )
    return Table("timings", "Computing", columns, rows, note)


def _timings_of(flights: Flights) -> Iterator[Row]:
    parts = [
        {"whole tick": flight.get("tick_ms"), **(flight.get("perception_ms") or {})}
        for flight in flights
    ]
    for stage in dict.fromkeys(stage for one in parts for stage in one):
        times = [found for one in parts if (found := one.get(stage))]
        if times:
            p50, p99, most = ([time[key] for time in times] for key in ("p50", "p99", "max"))
            numbers = (np.median(p50), np.median(p99), max(most))
            yield stage, len(times), *(round(float(number), 2) for number in numbers), None
    ended = [flight for flight in flights if flight.get("duration_s") and flight.get("wall_s")]
    if speeds := [flight["duration_s"] / flight["wall_s"] for flight in ended]:
        yield "flight", len(speeds), None, None, None, round(float(np.median(speeds)), 1)


def _flights(sets: Sequence[FlightSet]) -> Table:
    fields = ("scene", "seed", "outcome", "reason", "profile", *METRICS, "wall_s")
    rows = [[one.label, *map(flight.get, fields)] for one in sets for flight in _sorted(one)]
    return Table("flights", "All flights", ("tree", *fields), rows)


def _errors(mapped: Flights, field: str, *wanted: str) -> list[float | None]:
    """Return figures of the sizes of errors, which flights list in a field."""
    errors_m = stats.spread([abs(error) for each in mapped for error in each.get(field) or ()])
    if len(mapped) < stats.PERCENTILE_FLIGHTS:
        errors_m["95 %"] = None
    return [stats.rounded(errors_m[name], "map_drift_m") for name in wanted]


def _maps(sets: Sequence[FlightSet]) -> Table:
    rows: list[Row] = []
    for one in sets:
        mapped = [f for f in one.flights if f.get("objects_total") is not None]
        if mapped:
            found, total, false, restarts = (
                sum(flight.get(name) or 0 for flight in mapped)
                for name in ("objects_found", "objects_total", "false_objects", "map_restarts")
            )
            places = _errors(mapped, "object_errors_m", "mean", "median", "95 %", "most")
            heights = _errors(mapped, "object_height_errors_m", "median", "95 %")
            known = sum(len(flight.get("object_height_errors_m") or ()) for flight in mapped)
            shares = [
                round(100.0 * part / whole, 1) if whole else None
                for part, whole in ((found, total), (known, found))
            ]
            counts = one.label, len(mapped), found, total, shares[0], false
            rows.append([*counts, *places, shares[1], *heights, restarts])
    columns = (
        *("tree", "flights", "objects found", "of", "found, %", "false objects"),
        *("error, m: mean", "median", "95 %", "most"),
        *("heights known, %", "height error, m: median", "height, 95 %", "restarts"),
    )
    note = (
        f"An object is found if the map has one of its class within {FOUND_M:g} m. The pose "
        "at take-off aligns the map, so the errors of all found objects contain the drift."
    )
    return Table("map", "The mission's map", columns, rows, note)


def origin_table(one: FlightSet) -> Table:
    """Return the plan of a campaign and its runs: machines, versions and commits."""
    plan = {} if one.plan is None else one.plan.to_json()
    rows = [*flattened(plan), *flattened([*one.runs], "run")]
    rows = rows or [("file", "a plain file of flights, without a plan")]
    return Table("origin", f"Origin: {one.path}", ("what", "which"), rows)
