"""Comparison of trees on the same flights: pairs with equal scene and seed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, Final, NamedTuple

import numpy as np

from uav_bt.campaign.report import statistics as stats
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.tables import Row, Table
from uav_bt.campaign.store import METRICS
from uav_bt.errors import InputError
from uav_bt.types.arrays import Floats

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
    flights: list[tuple[Mapping[str, Any], Mapping[str, Any]]]  # lines of first and second

    def values(self, metric: str) -> Floats:
        """Return a metric of the pairs that both reached it, (2, N), as in reports."""
        both = [[stats.reached(flight, metric) for flight in pair] for pair in self.flights]
        known = [pair for pair in both if None not in pair]
        return np.array(known, dtype=np.float64).reshape(-1, 2).T

    def successes(self) -> tuple[int, int, int]:
        """Return in how many pairs only the first flight succeeded, only the second, and both."""
        ends = [[flight["outcome"] == stats.SUCCESS for flight in pair] for pair in self.flights]
        return ends.count([True, False]), ends.count([False, True]), ends.count([True, True])


def pairs_of(sets: Sequence[FlightSet], *, all_pairs: bool = False) -> list[Pairs]:
    """Return the trees that share flights: the first with each other, or all."""
    chosen = combinations(sets, 2) if all_pairs else ((sets[0], one) for one in sets[1:])
    found = (_paired(first, second) for first, second in chosen)
    return [pairs for pairs in found if pairs.flights]


def _paired(first: FlightSet, second: FlightSet) -> Pairs:
    plans = [one.plan for one in (first, second) if one.plan]
    planned = {(file.name, file.sha256) for plan in plans for file in plan.scenes}
    changed = [name for name, count in Counter(name for name, _ in planned).items() if count > 1]
    others = {(flight["scene"], flight["seed"]): flight for flight in second.flights}
    known = [flight for flight in first.flights if flight["scene"] not in (None, *changed)]
    keyed = ((flight, others.get((flight["scene"], flight["seed"]))) for flight in known)
    return Pairs(first, second, [(one, other) for one, other in keyed if other is not None])


def paired_table(pairs: Sequence[Pairs]) -> Table:
    """Return the comparison of trees on the same flights."""
    rows = [(one.first.label, one.second.label, *row) for one in pairs for row in _rows(one)]
    columns = (
        *("first tree", "second tree", "measure", "unit", "pairs"),
        *("first", "second", "second minus first", "from", "to", "p"),
    )
    note = (
        "A pair is a flight of each tree in the same scene with the same seed. Each metric "
        "counts the pairs in which both reached it and shows medians. The difference is the "
        "median of the paired ones, of shares in percentage points. From and to: its 95 % "
        "bootstrap interval. p: McNemar's exact test of success."
    )
    return Table("pairs", "Compared on the same flights", columns, rows, note)


def _rows(pairs: Pairs) -> Iterator[Row]:
    lost, gained, both = pairs.successes()
    p = float(f"{stats.mcnemar(gained, lost):.3g}")
    counts = (len(pairs.flights), lost + both, gained + both, gained - lost)
    yield "successes", None, *counts, None, None, p
    for name in _COMPARED:
        values = pairs.values(name)
        if values.size:
            change = values[1] - values[0]
            numbers = (*np.median(values, axis=1), np.median(change))
            interval = stats.median_interval(change)
            cells = (stats.rounded(each, name) for each in (*numbers, *interval))
            yield name, METRICS[name].unit, len(change), *cells, None


def losses_of(sets: Sequence[FlightSet]) -> list[str]:
    """Return a sentence for each figure in which a tree is worse than the first one.

    Worse: two more failures among the pairs, or a loss of `_LESS`. An InputError says that a
    tree shares no flight with the first.
    """
    pairs = pairs_of(sets)
    if len(sets) < 2 or len(pairs) < len(sets) - 1:
        alone = [one.label for one in sets[1:] if one not in [each.second for each in pairs]]
        raise InputError(
            "expected two trees or more with flights in the same scenes with the same seeds, "
            f"got {f'none in common of {sets[0].label} and ' if alone else 'one tree'}"
            + ", ".join(alone)
        )
    return [f"{one.second.label}: {loss}" for one in pairs for loss in _losses(one)]


def _losses(pairs: Pairs) -> Iterator[str]:
    lost, gained, _ = pairs.successes()
    if lost - gained > _MORE_FAILURES:
        yield f"{lost - gained} more failures"
    for name, statistic, percentile, allowed in _LESS:
        values, metric = pairs.values(name), METRICS[name]
        if values.size:
            before, now = np.percentile(values, percentile, axis=1)
            unit = "points" if metric.unit == "%" else metric.unit
            if before - now > allowed:
                yield f"{metric.words}: {statistic} {before - now:.3g} {unit} lower"
