"""Comparison of trees on the same flights: pairs with equal scene and seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import mcnemar, median_interval, reached
from uav_bt.campaign.report.table import Cell, Table, Term
from uav_bt.errors import InputError
from uav_bt.mission.judge import Outcome

_COMPARED: Final = ("coverage_passed", "min_clearance_m", "landing_error_m", "duration_s")

# Allowed loss: chosen, about the difference between flights of equal code.
_MORE_FAILURES: Final = 1
_LESS: Final[tuple[tuple[str, str, Callable[[Any], Any], float], ...]] = (
    ("coverage_passed", "median", np.median, 2.0),
    ("min_clearance_m", "5th percentile", lambda values: np.percentile(values, 5), 0.02),
)
"""Metric, name of its statistic, the statistic, and the allowed loss in the metric's unit."""

_NOTE: Final = (
    "A pair is a flight of each tree in the same scene with the same seed. Each metric counts the "
    "pairs in which both flights reached it and shows medians. The difference is the median of the "
    "paired differences; that of shares is in percentage points. From and to: its 95 % bootstrap "
    "interval. p: McNemar's exact test of success."
)


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Flights of two trees in the same scenes with the same seeds.

    Attributes:
        first: The first tree's flights.
        second: The second tree's flights.
        flights: The pairs: a line of the first tree and a line of the second.
    """

    first: FlightSet
    second: FlightSet
    flights: tuple[tuple[Mapping[str, Any], Mapping[str, Any]], ...]

    def successes(self) -> NDArray[np.bool_]:
        """Return which flights succeeded, (pairs, 2)."""
        good = Outcome.SUCCESS.value
        return np.array([[flight["outcome"] == good for flight in pair] for pair in self.flights])

    def values(self, metric: str) -> NDArray[np.float64]:
        """Return a metric of the pairs that both reached it, (N, 2), in its unit in reports."""
        both = [[reached(flight, metric) for flight in pair] for pair in self.flights]
        known = [pair for pair in both if None not in pair]
        return np.array(known, dtype=np.float64).reshape(-1, 2)


def pairs_of(sets: Sequence[FlightSet], *, all_pairs: bool = False) -> list[Pairs]:
    """Return the trees that share flights, two at a time.

    Args:
        sets: The trees' flights.
        all_pairs: Pair all trees with each other, not only the first with each other one.
    """
    chosen = combinations(sets, 2) if all_pairs else ((sets[0], one) for one in sets[1:])
    found = (_paired(first, second) for first, second in chosen)
    return [pairs for pairs in found if pairs.flights]


def _paired(first: FlightSet, second: FlightSet) -> Pairs:
    seconds = {
        (flight["scene"], flight["seed"]): flight
        for flight in second.flights
        if flight["scene"] is not None and _same_scene(first, second, flight["scene"])
    }
    keys = ((flight, (flight["scene"], flight["seed"])) for flight in first.flights)
    return Pairs(
        first=first,
        second=second,
        flights=tuple((flight, seconds[key]) for flight, key in keys if key in seconds),
    )


def _same_scene(first: FlightSet, second: FlightSet, scene: str) -> bool:
    """Return whether a scene is the same in both campaigns, as far as their plans are known."""
    texts = {
        file.sha256
        for one in (first, second)
        if one.source.plan is not None
        for file in one.source.plan.scenes
        if file.name == scene
    }
    return len(texts) <= 1


def paired_table(pairs: Sequence[Pairs]) -> Table:
    """Return the comparison of trees on the same flights."""
    return Table(
        name="pairs",
        title="Compared on the same flights",
        columns=(
            *("first tree", "second tree", "measure", "unit", "pairs"),
            *("first", "second", "second minus first", "from", "to", "p"),
        ),
        rows=tuple(row for one in pairs for row in _rows(one)),
        note=_NOTE,
    )


def _rows(pairs: Pairs) -> list[tuple[Cell, ...]]:
    labels = (pairs.first.label, pairs.second.label)
    good = pairs.successes()
    first, second = (int(count) for count in good.sum(axis=0))
    gained, lost = int((good[:, 1] & ~good[:, 0]).sum()), int((good[:, 0] & ~good[:, 1]).sum())
    p = float(f"{mcnemar(gained, lost):.3g}")
    rows: list[tuple[Cell, ...]] = [
        (*labels, "successes", None, len(good), first, second, second - first, None, None, p)
    ]
    for name in _COMPARED:
        values = pairs.values(name)
        if not values.size:
            continue
        metric, change = METRICS[name], values[:, 1] - values[:, 0]
        ends = median_interval(change) or (None, None)
        numbers = (*np.median(values, axis=0), np.median(change), *ends)
        # 0.0 is added because a small negative number is rounded to -0.0.
        rounded = (
            None if each is None else round(float(each), metric.digits) + 0.0 for each in numbers
        )
        measure = Term(text=metric.words, key=name)
        rows.append((*labels, measure, metric.unit, len(values), *rounded, None))
    return rows


def losses_of(sets: Sequence[FlightSet]) -> list[str]:
    """Return a sentence for each figure in which a tree is worse than the first one.

    Worse: two more failures among the pairs, a median coverage more than 2 points lower, or a 5th
    percentile of the least clearance more than 2 cm lower.

    Args:
        sets: The trees' flights.

    Raises:
        InputError: A tree shares no flight with the first.
    """
    pairs = pairs_of(sets)
    if len(sets) < 2 or len(pairs) < len(sets) - 1:
        alone = [one.label for one in sets[1:] if one not in [each.second for each in pairs]]
        raise InputError(
            "expected two trees or more with flights in the same scenes with the same seeds, got "
            + (f"none in common of {sets[0].label} and {', '.join(alone)}" if alone else "one tree")
        )
    return [sentence for one in pairs for sentence in _losses(one)]


def _losses(pairs: Pairs) -> list[str]:
    found = []
    first, second = (int(count) for count in pairs.successes().sum(axis=0))
    if first - second > _MORE_FAILURES:
        found.append(f"{pairs.second.label}: {first - second} more failures")
    for name, statistic, number, allowed in _LESS:
        values = pairs.values(name)
        if values.size and (less := number(values[:, 0]) - number(values[:, 1])) > allowed:
            metric = METRICS[name]
            unit = "points" if metric.unit == "%" else metric.unit
            found.append(
                f"{pairs.second.label}: {metric.words}: {statistic} {less:.3g} {unit} lower"
            )
    return found
