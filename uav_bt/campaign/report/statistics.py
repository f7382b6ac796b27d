"""What many flights say together: outcomes with intervals, distances and times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.intervals import wilson
from uav_bt.errors import InputError
from uav_bt.mission.judge import Outcome

__all__ = ["Distribution", "FlightsSummary", "by_tree", "summarise"]


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """A number that flights reached, in its own unit."""

    count: int  # flights that reached it
    mean: float
    median: float
    p5: float
    p95: float
    least: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Distribution | None:
        """Summarise numbers, None without any."""
        if not values:
            return None
        array = np.asarray(values, dtype=np.float64)
        p5, median, p95 = (float(value) for value in np.percentile(array, [5, 50, 95]))
        return cls(
            count=len(values),
            mean=float(array.mean()),
            median=median,
            p5=p5,
            p95=p95,
            least=float(array.min()),
            most=float(array.max()),
        )


@dataclass(frozen=True, kw_only=True)
class FlightsSummary:
    """A set of flights in numbers."""

    flights: int
    outcomes: dict[str, int]  # those that occurred, success first, then the most frequent
    success: float  # share, 0 to 1
    success_95: tuple[float, float]  # its 95 % Wilson interval
    metrics: dict[str, Distribution | None]  # by field of the flight's report

    def share_95(self, outcome: str) -> tuple[float, float]:
        """Return the 95 % Wilson interval of an outcome's share."""
        return wilson(self.outcomes.get(outcome, 0), self.flights)


def summarise(flights: Iterable[Mapping[str, Any]]) -> FlightsSummary:
    """Return what flights say together.

    Raises:
        InputError: there are none.
    """
    flown = list(flights)
    if not flown:
        raise InputError("there are no flights to summarise")
    counts = Counter(str(flight["outcome"]) for flight in flown)
    good = counts.pop(Outcome.SUCCESS.value, 0)
    return FlightsSummary(
        flights=len(flown),
        outcomes={Outcome.SUCCESS.value: good, **dict(counts.most_common())},
        success=good / len(flown),
        success_95=wilson(good, len(flown)),
        metrics={
            name: Distribution.of([f[name] for f in flown if f.get(name) is not None])
            for name in METRICS
        },
    )


def by_tree(flights: Iterable[Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return flights by their tree's name, trees in the order in which they first appear."""
    trees: dict[str, list[dict[str, Any]]] = {}
    for flight in flights:
        trees.setdefault(str(flight["tree"]), []).append(dict(flight))
    return trees
