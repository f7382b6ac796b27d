"""Statistics of many flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import scipy  # imports `scipy.stats`, which takes a second, when it is used

from uav_bt.campaign.report.sources import Flights
from uav_bt.campaign.store import METRICS
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.mission.judge import Outcome
from uav_bt.types.arrays import Floats

SUCCESS: Final = Outcome.SUCCESS.value
PERCENTILE_FLIGHTS: Final = 3  # smallest number with percentiles and intervals (chosen)
_PERCENT_FLIGHTS: Final = 10  # smallest number whose successes are given in percent (chosen)
_DIGITS: Final = {"s": 1, "m": 3, "%": 1, "": 2}  # decimal places by unit
_RESAMPLES: Final = 4_000  # chosen: the ends repeat to a few percent of the width


def reached(flight: Mapping[str, Any], metric: str) -> float | None:
    """Return a metric of a flight in its unit in reports; None if the flight did not reach it.

    The distance in the first 90 s counts only for flights of at least 90 s.
    """
    if metric == "explore_distance_m" and (flight.get("duration_s") or 0.0) < EXPLORE_S:
        return None
    value = flight.get(metric)
    return 100.0 * value if value is not None and METRICS[metric].unit == "%" else value


def values_of(flights: Flights, metric: str) -> list[float]:
    """Return a metric of the flights that reached it, in its unit in reports."""
    return [value for flight in flights if (value := reached(flight, metric)) is not None]


def rounded(value: float | None, metric: str) -> float | None:
    """Return a value of a metric with the digits that reports give."""
    # 0.0 is added because a small negative number is rounded to -0.0.
    return None if value is None else round(float(value), _DIGITS[METRICS[metric].unit]) + 0.0


def spread(values: Sequence[float]) -> dict[str, float | None]:
    """Return mean, median, percentiles and ends of values; None where there are too few."""
    names = ("mean", "median", "5 %", "95 %", "least", "most")
    if not values:
        return dict.fromkeys(names)
    numbers = [np.mean(values), *np.percentile(values, [50, 5, 95, 0, 100])]
    found: dict[str, float | None] = dict(zip(names, map(float, numbers), strict=True))
    few = dict.fromkeys(("5 %", "95 %")) if len(values) < PERCENTILE_FLIGHTS else {}
    return found | few


def successes(flights: Flights) -> int:
    """Return how many flights succeeded."""
    return sum(flight["outcome"] == SUCCESS for flight in flights)


def success_percent(flights: Flights) -> float | None:
    """Return the share of successes, %; None for a few flights, of which it says little."""
    share = 100.0 * successes(flights) / len(flights)
    return share if len(flights) >= _PERCENT_FLIGHTS else None


def success_words(flights: Flights) -> str:
    """Return the successes, for example `2 of 2` or `19 of 20, 95.0 %`."""
    percent = success_percent(flights)
    share = "" if percent is None else f", {percent:.1f} %"
    return f"{successes(flights)} of {len(flights)}{share}"


def success_interval(flights: Flights) -> tuple[float, float]:
    """Return the 95 % Wilson score interval (1927) of the share of successes, %."""
    ends = scipy.stats.binomtest(successes(flights), len(flights)).proportion_ci(method="wilson")
    return 100.0 * float(ends.low), 100.0 * float(ends.high)


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Return the exact 95 % interval of a Poisson rate, events per hour (Garwood, 1936)."""
    # Without an event the interval has one end only.
    chi2 = scipy.stats.chi2
    low = 0.0 if count == 0 else float(chi2.ppf(0.025, 2 * count)) / 2.0
    high = float(chi2.ppf(0.95 if count == 0 else 0.975, 2 * (count + 1))) / 2.0
    return low / hours, high / hours


def median_interval(values: Floats) -> tuple[float, float] | tuple[None, None]:
    """Return the 95 % percentile bootstrap of a median (Efron and Tibshirani, 1993)."""
    if values.size < PERCENTILE_FLIGHTS:
        return None, None
    rng = np.random.default_rng(0)
    found = scipy.stats.bootstrap(
        (values,), np.median, n_resamples=_RESAMPLES, method="percentile", rng=rng
    )
    low, high = found.confidence_interval
    return float(low), float(high)


def mcnemar(gained: int, lost: int) -> float:
    """Return the two-sided p value of McNemar's exact test (1947), 0 to 1.

    `gained` counts the pairs in which only the second flight succeeded, `lost` the opposite.
    """
    trials = gained + lost
    return float(scipy.stats.binomtest(gained, trials).pvalue) if trials else 1.0
