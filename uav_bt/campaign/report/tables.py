"""Tables of a report."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.report.paper import paper_figures, paper_success
from uav_bt.campaign.report.rates import rates_of
from uav_bt.campaign.report.repeat import repeat_command
from uav_bt.campaign.report.sources import FlightSet, Sources
from uav_bt.campaign.report.statistics import FlightsSummary, summarise
from uav_bt.campaign.report.table import Cell, Link, Table, Term
from uav_bt.mission.covered_ground import PASSED_M, SEEN_M
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.mission.judge import Outcome

_SUCCESS: Final = Outcome.SUCCESS.value
_METRIC_NOTES: Final = {
    "": "Flights: the number of flights that reached the metric.",
    "explore_distance_m": f"The first {EXPLORE_S:.0f} s begin with the take-off command; shorter "
    "flights do not count.",
    "search_distance_m": "The search lasts from the end of exploration until the mark is found.",
    "coverage_passed": f"Passed: within {PASSED_M:g} m of the flown path. Seen: in view, not "
    f"hidden, within {SEEN_M:g} m of the lens.",
    "min_clearance_m": "Least clearance: the smallest distance of the hull from a box or mover.",
}
"""Notes on the metrics that have values; the first is always shown."""


def tables_of(sources: Sources, page: Path) -> dict[str, Table]:
    """Return the report's tables by name.

    Args:
        sources: The flights.
        page: The page; links are relative to its folder.
    """
    tables = (
        _outcomes(sources.sets),
        _scenes(sources),
        _metrics(sources.sets),
        rates_of(sources.sets),
        _failures(sources.sets, page),
        _timings(sources.sets),
        _flights(sources.sets),
    )
    return {table.name: table for table in tables}


_SUCCESS_COLUMNS: Final = ("flights", "successes", "success, %", "from, %", "to, %")


def _success_cells(summary: FlightsSummary) -> tuple[Cell, ...]:
    percent, good = summary.success_percent, summary.successes
    return (
        summary.flights,
        Term(text=f"{good} of {summary.flights}", key=str(good)),
        None if percent is None else round(percent, 1),
        *(round(100.0 * end, 1) for end in summary.success_95),
    )


def _outcomes(sets: Sequence[FlightSet]) -> Table:
    failures = [outcome.value for outcome in Outcome if outcome is not Outcome.SUCCESS]
    rows: list[tuple[Cell, ...]] = []
    for one in sets:
        summary = summarise(one.flights)
        counts = (summary.outcomes.get(outcome, 0) for outcome in failures)
        rows.append((one.label, *_success_cells(summary), *counts))
    names = (outcome.replace("_", " ") for outcome in failures)
    return Table(
        name="outcomes",
        title="Outcomes",
        columns=("tree", *_SUCCESS_COLUMNS, *names),
        rows=tuple(rows),
        note="From and to: the 95 % Wilson interval of the share of successes.",
    )


def _scenes(sources: Sources) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for one in sources.sets:
        for scene in sources.scenes:
            flown = [flight for flight in one.flights if flight["scene"] == scene]
            if flown:
                rows.append((one.label, scene, *_success_cells(summarise(flown))))
    return Table(
        name="scenes",
        title="By scene",
        columns=("tree", "scene", *_SUCCESS_COLUMNS),
        rows=tuple(rows),
    )


def _metrics(sets: Sequence[FlightSet]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    summaries = [(one, summarise(one.flights)) for one in sets]
    known = bool(paper_success(one.tree for one in sets))
    for name, metric in METRICS.items():
        for one, summary in summaries:
            found = summary.metrics[name]
            if found is not None:
                numbers = (found.mean, found.median, found.p5, found.p95, found.least, found.most)
                digits = metric.digits
                rounded = (None if number is None else round(number, digits) for number in numbers)
                row: tuple[Cell, ...] = (
                    Term(text=metric.words, key=name),
                    metric.unit or None,
                    one.label,
                    found.count,
                    *rounded,
                )
                quoted = "; ".join(figure.text for figure in paper_figures(name, [one.tree]))
                rows.append((*row, quoted or None) if known else row)
    shown = {name for name in METRICS if any(s.metrics[name] for _, s in summaries)}
    return Table(
        name="metrics",
        title="Times and distances",
        columns=(
            *("metric", "unit", "tree", "flights", "mean", "median"),
            *("5 %", "95 %", "least", "most"),
            *(("paper",) if known else ()),
        ),
        rows=tuple(rows),
        note=" ".join(note for name, note in _METRIC_NOTES.items() if name in {"", *shown}),
    )


def _failures(sets: Sequence[FlightSet], page: Path) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            one.label,
            flight["scene"],
            flight["seed"],
            flight["outcome"].replace("_", " "),
            flight.get("reason"),
            flight.get("duration_s"),
            _record(one, flight, page),
            repeat_command(one, flight),
        )
        for one in sets
        for flight in sorted(one.flights, key=lambda f: (str(f["scene"]), f["seed"]))
        if flight["outcome"] != _SUCCESS
    ]
    return Table(
        name="failures",
        title="Every failure",
        columns=(
            *("tree", "scene", "seed", "outcome", "reason"),
            *("after, s", "record", "command to repeat"),
        ),
        rows=tuple(rows),
        code=frozenset({"command to repeat"}),
    )


def _record(one: FlightSet, flight: dict[str, Any], page: Path) -> Link | None:
    if not flight.get("record"):
        return None
    record = one.source.folder / flight["record"]
    if not record.is_file():
        return None
    target = os.path.relpath(record.resolve(), page.resolve().parent)
    return Link(text="record", target=Path(target).as_posix())


def _timings(sets: Sequence[FlightSet]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for one in sets:
        stages = dict.fromkeys(stage for f in one.flights for stage in f.get("perception_ms") or {})
        for stage in (None, *stages):
            found = [
                times
                for flight in one.flights
                if (
                    times := flight.get("tick_ms")
                    if stage is None
                    else (flight.get("perception_ms") or {}).get(stage)
                )
            ]
            if found:
                middle, late, worst = (
                    np.array([times[name] for times in found]) for name in ("p50", "p99", "max")
                )
                numbers = (np.median(middle), np.median(late), worst.max())
                rounded = (round(float(number), 2) for number in numbers)
                rows.append((one.label, stage or "whole tick", len(found), *rounded, None))
        speeds = [f["duration_s"] / f["wall_s"] for f in one.flights if _timed(f)]
        if speeds:
            speed = round(float(np.median(speeds)), 1)
            rows.append((one.label, "flight", len(speeds), None, None, None, speed))
    return Table(
        name="timings",
        title="Computing",
        columns=(
            "tree",
            "stage",
            "flights",
            "p50, ms",
            "p99, ms",
            "longest, ms",
            "times real time",
        ),
        rows=tuple(rows),
        note="p50 and p99: medians over the flights of each flight's percentiles. Longest: the "
        "maximum of all flights. One inference thread; other flights ran at the same time.",
    )


def _timed(flight: dict[str, Any]) -> bool:
    return bool(flight.get("duration_s") and flight.get("wall_s"))


def _flights(sets: Sequence[FlightSet]) -> Table:
    fields = ("scene", "seed", "outcome", "reason", "profile", *METRICS, "wall_s")
    return Table(
        name="flights",
        title="All flights",
        columns=("tree", *fields),
        rows=tuple(
            (one.label, *(flight.get(field) for field in fields))
            for one in sets
            for flight in sorted(one.flights, key=lambda f: (str(f["scene"]), f["seed"]))
        ),
    )
