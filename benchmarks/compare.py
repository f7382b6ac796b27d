"""Comparison of campaigns, flight by flight: which one is better, and by how much.

    uav-bt campaign survey_and_land --exact-masks --out runs/map
    uav-bt campaign survey_and_land --exact-masks --policy Explore=segmentation \
        --policy Avoid=segmentation --out runs/rule
    python benchmarks/compare.py runs/map runs/rule

A set of flights is the folder of a campaign, or FOLDER:TREE for one of its missions. Flights are
paired by scene and seed, and by mission where a set has several. Differences are the later set
minus the first. Intervals are 95 % intervals: Wilson's for shares, the percentile bootstrap's for
means; the p value is that of McNemar's exact test.
`--not-worse` ends with exit code 1 if a later set is worse than the first: two more failures
among the pairs, median coverage 2 points lower, or the 5th percentile of clearance 2 cm lower.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from uav_bt.campaign.flight_lines import key_of, read_flights
from uav_bt.campaign.report.statistics import mcnemar, mean_interval, wilson
from uav_bt.campaign.store import FLIGHTS_FILE
from uav_bt.errors import InputError, UavBtError

Flight = Mapping[str, Any]
Key = tuple[Any, ...]  # scene, seed, and the mission where a set has several

# Allowed loss: chosen, about the difference between flights of equal code.
_MORE_FAILURES: Final = 1
_LESS_COVERAGE: Final = 0.02
_LESS_CLEARANCE_M: Final = 0.02


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A number of a flight."""

    title: str
    value: Callable[[Flight], float | None]  # None where the flight did not reach it
    digits: int = 2


def covered_in(seconds: float) -> Callable[[Flight], float | None]:
    """Return a function that reads the share of the free ground covered in a time, from 0 to 1."""

    def read(flight: Flight) -> float | None:
        curve = [passed for t, passed, _ in flight.get("coverage_curve") or [] if t <= seconds]
        return curve[-1] if curve else None

    return read


def time_home_s(flight: Flight) -> float | None:
    """Return the time from the end of exploring until motors off; None without a landing."""
    parts = flight.get("time_to_find_helipad_s"), flight.get("time_to_land_s")
    return None if None in parts else sum(parts)


def objects_share(flight: Flight) -> float | None:
    """Return the share of the place's objects that the map has."""
    found, total = flight.get("objects_found"), flight.get("objects_total")
    return None if found is None or not total else found / total


def field(name: str) -> Callable[[Flight], float | None]:
    """Return a function that reads a field of a flight."""
    return lambda flight: flight.get(name)


CLEARANCE: Final = Metric(title="clearance, m", value=field("min_clearance_m"))
COVERAGE: Final = Metric(title="covered in 180 s", value=covered_in(180.0))
METRICS: Final = (
    Metric(title="covered in 90 s", value=field("coverage_passed_90s")),
    COVERAGE,
    CLEARANCE,
    Metric(title="time home, s", value=time_home_s, digits=1),
    Metric(title="landing error, m", value=field("landing_error_m")),
    Metric(title="drift of the map, m", value=field("map_drift_m")),
    Metric(title="objects found", value=objects_share),
    Metric(title="objects that are not there", value=field("false_objects")),
    Metric(title="distance, m", value=field("total_distance_m"), digits=1),
    Metric(title="duration, s", value=field("duration_s"), digits=1),
)


def read_sets(names: Sequence[str]) -> dict[str, dict[Key, Flight]]:
    """Return the flights of each set by key.

    Raises:
        InputError: A set holds no flights or a damaged line, or its name is repeated.
    """
    if len(set(names)) != len(names):
        raise InputError(f"expected different sets, got {' '.join(names)}")
    sets = {name: _read_set(name) for name in names}
    several = any(len({key_of(flight)[0] for flight in flights}) > 1 for flights in sets.values())
    return {
        name: {key_of(flight) if several else key_of(flight)[1:]: flight for flight in flights}
        for name, flights in sets.items()
    }


def _read_set(name: str) -> list[dict[str, Any]]:
    folder, _, tree = name.partition(":")
    lines = read_flights(Path(folder) / FLIGHTS_FILE)
    if lines.damaged:
        raise InputError(f"expected whole flights, got {lines.damaged[0]}: fly the campaign again")
    flights = [flight for flight in lines.flights if not tree or flight["tree"] == tree]
    if not flights:
        known = ", ".join(sorted({str(flight["tree"]) for flight in lines.flights})) or "none"
        raise InputError(f"expected flights in {name}, got none (missions there: {known})")
    return flights


def values_of(flights: Sequence[Flight], metric: Metric) -> np.ndarray:
    """Return a metric of the flights that reached it, (N,)."""
    values = (metric.value(flight) for flight in flights)
    return np.array([value for value in values if value is not None], dtype=np.float64)


def successes(flights: Sequence[Flight]) -> int:
    """Return the number of successful flights."""
    return sum(flight["outcome"] == "success" for flight in flights)


def sets_table(sets: Mapping[str, Mapping[Key, Flight]]) -> list[str]:
    """Return a Markdown table with one column per set: mean (median; 5th percentile; least)."""
    rows = [["mean (median; 5 %; least)", *sets], ["---"] * (len(sets) + 1)]
    landed = ["success"]
    for flights in sets.values():
        good, count = successes(list(flights.values())), len(flights)
        low, high = wilson(good, count)
        landed.append(f"{good} of {count} ({100 * low:.0f} to {100 * high:.0f} %)")
    rows.append(landed)
    for metric in METRICS:
        columns = [values_of(list(flights.values()), metric) for flights in sets.values()]
        rows.append([metric.title, *(_summary(values, metric.digits) for values in columns)])
    return [f"| {' | '.join(row)} |" for row in rows]


def _summary(values: np.ndarray, digits: int) -> str:
    if not values.size:
        return ""
    numbers = values.mean(), np.median(values), np.percentile(values, 5), values.min()
    mean, *others = (f"{number:.{digits}f}" for number in numbers)
    return f"{mean} ({'; '.join(others)})"


def pairs_of(
    first: Mapping[Key, Flight], other: Mapping[Key, Flight]
) -> list[tuple[Flight, Flight]]:
    """Return the flights that both sets have.

    Raises:
        InputError: The sets have no flight in common.
    """
    pairs = [(flight, other[key]) for key, flight in first.items() if key in other]
    if not pairs:
        raise InputError(
            "expected flights of the same scenes and seeds in all sets, got none in common"
        )
    return pairs


def differences_table(pairs: Sequence[tuple[Flight, Flight]]) -> list[str]:
    """Return a Markdown table of the paired differences."""
    lost = sum(successes(pair) == 1 and successes(pair[:1]) == 1 for pair in pairs)
    won = sum(successes(pair) == 1 and successes(pair[1:]) == 1 for pair in pairs)
    lines = [
        (
            f"{len(pairs)} pairs: {won} successes gained, {lost} lost "
            f"(McNemar, p = {mcnemar(won, lost):.3f})"
        ),
        "",
        "| difference | pairs | mean (95 %) | median |",
        "| --- | --- | --- | --- |",
    ]
    for metric in METRICS:
        both = [(metric.value(one), metric.value(two)) for one, two in pairs]
        deltas = np.array([b - a for a, b in both if a is not None and b is not None])
        if not deltas.size:
            continue
        numbers = deltas.mean(), np.median(deltas), *mean_interval(deltas)
        mean, median, *ends = (f"{number:+.{metric.digits}f}" for number in numbers)
        between = f" ({' to '.join(ends)})" if ends else ""
        lines.append(f"| {metric.title} | {deltas.size} | {mean}{between} | {median} |")
    return lines


def losses(pairs: Sequence[tuple[Flight, Flight]]) -> list[str]:
    """Return a phrase for each figure in which the second flights are worse than the first."""
    first, other = [one for one, _ in pairs], [two for _, two in pairs]
    found = []
    if (more := successes(first) - successes(other)) > _MORE_FAILURES:
        found.append(f"{more} more failures")
    for metric, number, least in (
        (COVERAGE, np.median, _LESS_COVERAGE),
        (CLEARANCE, lambda values: np.percentile(values, 5), _LESS_CLEARANCE_M),
    ):
        before, after = values_of(first, metric), values_of(other, metric)
        if before.size and after.size and (less := number(before) - number(after)) > least:
            found.append(f"{metric.title}: {less:.3f} less")
    return found


def main(words: Sequence[str] | None = None) -> int:
    """Print the comparison and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sets", nargs="+", metavar="FOLDER[:TREE]")
    parser.add_argument("--not-worse", action="store_true", help="exit with 1 if a set is worse")
    given = parser.parse_args(words)
    if len(given.sets) < 2:
        parser.error("expected two sets of flights or more")
    try:
        sets = read_sets(given.sets)
        paired = {name: pairs_of(sets[given.sets[0]], sets[name]) for name in given.sets[1:]}
    except UavBtError as error:
        parser.exit(2, f"{error}\n")
    print(*sets_table(sets), sep="\n")
    worse = False
    for name, pairs in paired.items():
        found = losses(pairs)
        worse = worse or bool(found)
        print(f"\n{name} minus {given.sets[0]}:", *differences_table(pairs), sep="\n")
        print(f"\n{'worse: ' + ', '.join(found) if found else 'not worse'}")
    return 1 if worse and given.not_worse else 0


if __name__ == "__main__":
    sys.exit(main())
