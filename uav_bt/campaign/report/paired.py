"""Comparison of trees on the same flights: pairs with equal scene and seed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.report.statistics import (
    SUCCESS,
    mcnemar,
    median_interval,
    reached,
    rounded,
    successes,
)
from uav_bt.campaign.report.tables import Cell, Table, Value
from uav_bt.errors import InputError

_COMPARED: Final = ("coverage_passed", "min_clearance_m", "landing_error_m", "duration_s")

# Allowed loss: chosen, about the difference between flights of equal code.
_MORE_FAILURES: Final = 1
# Metric, name of its statistic, its percentile, and the allowed loss in the metric's unit.
_LESS: Final = (
    ("coverage_passed", "median", 50, 2.0),
    ("min_clearance_m", "5th percentile", 5, 0.02),
)


class Pairs(NamedTuple):
    """Flights of two trees in the same scenes with the same seeds."""

    first: FlightSet
    second: FlightSet
    flights: tuple[Flights, Flights]  # lines of the first tree and, in the same order, the second

    def values(self, metric: str) -> NDArray[np.float64]:
        """Return a metric of the pairs that both reached it, (2, N), in its unit in reports."""
        both = [
            [reached(flight, metric) for flight in pair] for pair in zip(*self.flights, strict=True)
        ]
        known = [pair for pair in both if None not in pair]
        return np.array(known, dtype=np.float64).reshape(-1, 2).T


def pairs_of(sets: Sequence[FlightSet], *, all_pairs: bool = False) -> list[Pairs]:
    """Return the trees that share flights: the first with each other, or all with each other."""
    chosen = combinations(sets, 2) if all_pairs else ((sets[0], one) for one in sets[1:])
    found = (Pairs(first, second, _shared(first, second)) for first, second in chosen)
    return [pairs for pairs in found if pairs.flights[0]]


def _shared(first: FlightSet, second: FlightSet) -> tuple[Flights, Flights]:
    plans = [one.source.plan for one in (first, second) if one.source.plan is not None]
    scenes = {(file.name, file.sha256) for plan in plans for file in plan.scenes}
    changed = [name for name, count in Counter(name for name, _ in scenes).items() if count > 1]
    seconds = {(flight["scene"], flight["seed"]): flight for flight in second.flights}
    pairs = [
        (flight, seconds[key])
        for flight in first.flights
        if (key := (flight["scene"], flight["seed"])) in seconds
        and flight["scene"] not in (None, *changed)
    ]
    return [one for one, _ in pairs], [other for _, other in pairs]


def paired_table(pairs: Sequence[Pairs]) -> Table:
    """Return the comparison of trees on the same flights."""
    return Table(
        name="pairs",
        title="Compared on the same flights",
        columns=(
            *("first tree", "second tree", "measure", "unit", "pairs"),
            *("first", "second", "second minus first", "from", "to", "p"),
        ),
        rows=[(one.first.label, one.second.label, *row) for one in pairs for row in _rows(one)],
        note="A pair is a flight of each tree in the same scene with the same seed. Each metric "
        "counts the pairs in which both flights reached it and shows medians. The difference is "
        "the median of the paired differences; that of shares is in percentage points. From and "
        "to: its 95 % bootstrap interval. p: McNemar's exact test of success.",
    )


def _rows(pairs: Pairs) -> Iterator[Sequence[Value]]:
    first, second = map(successes, pairs.flights)
    ends = [
        [flight["outcome"] == SUCCESS for flight in pair]
        for pair in zip(*pairs.flights, strict=True)
    ]
    p = float(f"{mcnemar(ends.count([False, True]), ends.count([True, False])):.3g}")
    yield "successes", None, len(ends), first, second, second - first, None, None, p
    for name in _COMPARED:
        values = pairs.values(name)
        if values.size:
            change = values[1] - values[0]
            numbers = (*np.median(values, axis=1), np.median(change))
            cells = (
                rounded(each, name)
                for each in (*numbers, *(median_interval(change) or (None,) * 2))
            )
            measure = Cell(name, Markup.escape(METRICS[name].words))
            yield measure, METRICS[name].unit, len(change), *cells, None


def losses_of(sets: Sequence[FlightSet]) -> list[str]:
    """Return a sentence for each figure in which a tree is worse than the first one.

    Worse: two more failures among the pairs, a median coverage more than 2 points lower, or a 5th
    percentile of the least clearance more than 2 cm lower. An InputError says that a tree shares
    no flight with the first.
    """
    pairs = pairs_of(sets)
    if len(sets) < 2 or len(pairs) < len(sets) - 1:
        alone = [one.label for one in sets[1:] if one not in [each.second for each in pairs]]
        raise InputError(
            "expected two trees or more with flights in the same scenes with the same seeds, got "
            + (f"none in common of {sets[0].label} and {', '.join(alone)}" if alone else "one tree")
        )
    return [f"{one.second.label}: {loss}" for one in pairs for loss in _losses(one)]


def _losses(pairs: Pairs) -> Iterator[str]:
    first, second = map(successes, pairs.flights)
    if first - second > _MORE_FAILURES:
        yield f"{first - second} more failures"
    for name, statistic, percentile, allowed in _LESS:
        values, metric = pairs.values(name), METRICS[name]
        if values.size:
            before, now = np.percentile(values, percentile, axis=1)
            unit = "points" if metric.unit == "%" else metric.unit
            if before - now > allowed:
                yield f"{metric.words}: {statistic} {before - now:.3g} {unit} lower"
