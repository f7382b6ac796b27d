"""Statistics of many flights: outcomes with intervals, metrics, densities."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, bootstrap, gaussian_kde

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.mission.judge import Outcome

_RESAMPLES: Final = 4_000  # chosen: the interval's ends repeat to a few percent of its width
PERCENTILE_FLIGHTS: Final = 3
"""Smallest number of flights with a 5th and a 95th percentile (chosen)."""
PERCENT_FLIGHTS: Final = 10
"""Smallest number of flights whose successes are given in percent (chosen)."""


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """Distribution of a metric, in the unit of its reports.

    Attributes:
        count: Number of flights that have the metric.
        mean: Mean.
        median: Median.
        p5: 5th percentile. None: fewer than `PERCENTILE_FLIGHTS` flights.
        p95: 95th percentile. None: fewer than `PERCENTILE_FLIGHTS` flights.
        least: Smallest value.
        most: Largest value.
    """

    count: int
    mean: float
    median: float
    p5: float | None
    p95: float | None
    least: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Distribution | None:
        """Summarise numbers, None without any."""
        if not values:
            return None
        array = np.asarray(values, dtype=np.float64)
        p5, median, p95 = (float(value) for value in np.percentile(array, [5, 50, 95]))
        enough = len(values) >= PERCENTILE_FLIGHTS
        return cls(
            count=len(values),
            mean=float(array.mean()),
            median=median,
            p5=p5 if enough else None,
            p95=p95 if enough else None,
            least=float(array.min()),
            most=float(array.max()),
        )


@dataclass(frozen=True, kw_only=True)
class FlightsSummary:
    """Statistics of a set of flights.

    Attributes:
        flights: Number of flights.
        outcomes: Number of flights by outcome: success, then the others by frequency.
        successes: Number of successful flights.
        success_95: The 95 % Wilson interval of the share of successes, 0 to 1.
        metrics: Distributions by field of the flight's line. None: no flight has the metric.
    """

    flights: int
    outcomes: dict[str, int]
    successes: int
    success_95: tuple[float, float]
    metrics: dict[str, Distribution | None]

    @property
    def success_percent(self) -> float | None:
        """Share of successes, %; None for fewer than `PERCENT_FLIGHTS` flights."""
        enough = self.flights >= PERCENT_FLIGHTS
        return 100.0 * self.successes / self.flights if enough else None

    @property
    def success_text(self) -> str:
        """Successes in words, for example `2 of 2` or `19 of 20, 95.0 %`."""
        share = "" if (percent := self.success_percent) is None else f", {percent:.1f} %"
        return f"{self.successes} of {self.flights}{share}"


def summarise(flights: Iterable[Mapping[str, Any]]) -> FlightsSummary:
    """Return the statistics of flights.

    Raises:
        InputError: There are no flights.
    """
    flown = list(flights)
    if not flown:
        raise InputError("there are no flights to summarise")
    counts = Counter(str(flight["outcome"]) for flight in flown)
    good = counts.pop(Outcome.SUCCESS.value, 0)
    return FlightsSummary(
        flights=len(flown),
        outcomes={Outcome.SUCCESS.value: good, **dict(counts.most_common())},
        successes=good,
        success_95=wilson(good, len(flown)),
        metrics={
            name: Distribution.of([value for f in flown if (value := reached(f, name)) is not None])
            for name in METRICS
        },
    )


def reached(flight: Mapping[str, Any], metric: str) -> float | None:
    """Return a metric of a flight in its unit in reports; None if the flight did not reach it.

    The distance in the first 90 s counts only for flights of at least 90 s.

    Args:
        flight: The flight's line.
        metric: One of `METRICS`.
    """
    if metric == "explore_distance_m" and (flight.get("duration_s") or 0.0) < EXPLORE_S:
        return None
    value = flight.get(metric)
    return 100.0 * value if value is not None and METRICS[metric].unit == "%" else value


def by_tree(flights: Iterable[Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return flights by the name of their tree; trees are in order of first appearance."""
    trees: dict[str, list[dict[str, Any]]] = {}
    for flight in flights:
        trees.setdefault(str(flight["tree"]), []).append(dict(flight))
    return trees


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a proportion, 0 to 1.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22
    (1927). Unlike the textbook interval it is meaningful at 0 and at 100 %.

    Args:
        successes: Number of successful trials.
        trials: Number of trials, at least one.

    Raises:
        ValueRangeError: There are no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise ValueRangeError(
            f"an interval needs 0 <= successes <= trials and a trial, got {successes} of {trials}"
        )
    ends = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(ends.low), float(ends.high)


def median_interval(values: NDArray[np.float64]) -> tuple[float, float] | None:
    """Return the 95 % interval of a median, by the percentile bootstrap with a fixed seed.

    B. Efron, R. Tibshirani, An introduction to the bootstrap (1993), chapter 13.

    Args:
        values: The sample, (N,).

    Returns:
        The ends of the interval. None: fewer than `PERCENTILE_FLIGHTS` values.
    """
    if values.size < PERCENTILE_FLIGHTS:
        return None
    rng = np.random.default_rng(0)
    found = bootstrap((values,), np.median, n_resamples=_RESAMPLES, method="percentile", rng=rng)
    low, high = found.confidence_interval
    return float(low), float(high)


def mcnemar(gained: int, lost: int) -> float:
    """Return the two-sided p value of McNemar's exact test of paired successes, 0 to 1.

    Q. McNemar, Note on the sampling error of the difference between correlated proportions or
    percentages, Psychometrika 12 (1947), with the binomial distribution.

    Args:
        gained: Number of pairs in which only the second flight succeeded.
        lost: Number of pairs in which only the first flight succeeded.
    """
    return float(binomtest(gained, gained + lost).pvalue) if gained + lost else 1.0


def bandwidth(values: Sequence[float]) -> float:
    """Return Silverman's bandwidth of a Gaussian kernel density, in the values' unit.

    B. W. Silverman, Density estimation for statistics and data analysis (1986), equation 3.31;
    SciPy's rule of that name does not use the quartiles.
    """
    array = np.asarray(values, dtype=np.float64)
    std = float(array.std(ddof=1)) if len(array) > 1 else 0.0
    upper, lower = np.percentile(array, [75, 25])
    spreads = [spread for spread in (std, float(upper - lower) / 1.34) if spread > 0.0]
    # If most values are equal, the quartiles are equal too and the deviation alone counts.
    return 0.9 * min(spreads) * len(array) ** -0.2 if spreads else 0.0


def density(values: Sequence[float], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the density of values of at least zero; the part below zero is reflected.

    Args:
        values: Values of at least zero, two different ones or more.
        at: Points of evaluation of at least zero, (N,).

    Returns:
        The density, (N,); its integral from zero upwards is 1.
    """
    kernel = gaussian_kde(values, bw_method=bandwidth(values) / np.std(values, ddof=1))
    return np.asarray(kernel(at) + kernel(-at))
