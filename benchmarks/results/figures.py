"""Figures of the page: a value of many flights or of one measure, with its 95 % interval."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple

import numpy as np
import scipy

from benchmarks.results.measuring import Results
from uav_bt.campaign.report import statistics as stats
from uav_bt.errors import InputError
from uav_bt.files import write_whole
from uav_bt.yaml_file import read_yaml

SUMMARY: Final = "summary.json"
TOLERANCE: Final = 0.05  # relative, of a measure whose entry states none
_NUMBER: Final = re.compile(r"(?<![\w.])\d+(?:,\d{3})*(?:\.\d+)?")


class Figure(NamedTuple):
    """A figure of the page."""

    value: float
    low: float | None = None  # of the 95 % interval; None: an extreme, which has none
    high: float | None = None
    n: int = 1


class Figures:
    """All figures that a page asks for, by name. Flights are those of CAMPAIGN or CAMPAIGN/TREE."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.used: dict[str, Figure] = {}

    def flights(self, of: str) -> Sequence[Mapping[str, Any]]:
        """Return the kept lines of flights."""
        campaign, _, tree = of.partition("/")
        flights = self.results.flights(campaign)
        found = [line for line in flights if not tree or PurePath(line["tree"]).stem == tree]
        if not found:
            raise InputError(f"no flights of '{of}' are kept: `make results` flies them")
        return found

    def landed(self, of: str) -> Figure:
        """Return how many flights succeeded."""
        flights = self.flights(of)
        return self._share(f"{of} landed", stats.successes(flights), len(flights))

    def failures(self, of: str, why: str = "") -> str:
        """Return how others ended whose reason has the text `why`."""
        flights = (one for one in self.flights(of) if why in one.get("reason", ""))
        ends = Counter(one["outcome"] for one in flights if one["outcome"] != "success")
        return ", ".join(f"{count} {end}" for end, count in ends.most_common()) or "no failure"

    def found(self, of: str) -> Figure:
        """Return how many of all objects the maps have."""
        names = ("objects_found", "objects_total")
        sums = (sum(int(one.get(name, 0)) for one in self.flights(of)) for name in names)
        return self._share(f"{of} objects", *sums)

    def mean(self, of: str, metric: str) -> Figure:
        """Return the mean of a metric, in its unit in reports, with its bootstrap interval."""
        values = np.array(self._values(of, metric))
        low = high = values.mean()
        if np.ptp(values) > 0.0:
            rng = np.random.default_rng(0)
            ends = scipy.stats.bootstrap((values,), np.mean, method="percentile", rng=rng)
            low, high = ends.confidence_interval
        return self._use(f"{of} mean {metric}", values.mean(), low, high, n=values.size)

    def extreme(self, of: str, metric: str, which: str) -> Figure:
        """Return the `least` or the `most` of a metric."""
        values = self._values(of, metric)
        value = min(values) if which == "least" else max(values)
        return self._use(f"{of} {which} {metric}", value, n=len(values))

    def hours(self, of: str) -> Figure:
        """Return hours of flight."""
        seconds = [line.get("duration_s", 0.0) for line in self.flights(of)]
        return self._use(f"{of} hours", sum(seconds) / 3600.0, n=len(seconds))

    def contacts(self, of: str) -> Figure:
        """Return contacts in 100 hours; n is their number."""
        count = sum(line["outcome"] == "collision" for line in self.flights(of))
        hundreds = self.hours(of).value / 100.0
        ends = stats.rate_interval(count, hundreds)
        return self._use(f"{of} contacts", count / hundreds, *ends, n=count)

    def measured(self, name: str, label: str, place: int = 0) -> Figure:
        """Return a number beside the leftmost label of an output, within the plan's tolerance."""
        value = self._number(name, label, place)
        off = value * self.results.plan[name].get("tolerance", TOLERANCE)
        return self._use(f"{name}: {label.strip()} {place}", value, value - off, value + off)

    def ratio(self, name: str, label: str) -> Figure:
        """Return the first two numbers beside a label, `229 of 231`, as a share."""
        count, total = (int(self._number(name, label, place)) for place in (0, 1))
        return self._share(f"{name}: {label}", count, total)

    def lines(self, name: str) -> list[str]:
        """Return the lines that a measure printed."""
        if about := self.results.about(name):
            return list(about["lines"])
        raise InputError(f"'{name}' was not measured: `make results` does it")

    def write(self) -> None:
        """Write the figures that were asked for, one a line."""
        lines = (f"{json.dumps(name)}: {json.dumps(one)}" for name, one in self.used.items())
        write_whole(self.results.folder / SUMMARY, "{\n" + ",\n".join(lines) + "\n}\n")

    def _number(self, name: str, label: str, place: int) -> float:
        lines = [line for line in self.lines(name) if label in line]
        line = min(lines, key=lambda line: line.find(label), default="")
        numbers = _NUMBER.findall(line.replace(label, ""))
        if place >= len(numbers):
            raise InputError(f"{name} of plan.yaml prints no {place + 1} numbers with '{label}'")
        return float(numbers[place].replace(",", ""))

    def _values(self, of: str, metric: str) -> list[float]:
        if values := list(stats.values_of(self.flights(of), metric)):
            return values
        raise InputError(f"no flight of '{of}' has '{metric}'")

    def _share(self, name: str, count: int, total: int) -> Figure:
        ends = scipy.stats.binomtest(count, total).proportion_ci(method="wilson")
        return self._use(name, count, 100.0 * ends.low, 100.0 * ends.high, n=total)

    def _use(self, name: str, *ends: float, n: int = 1) -> Figure:
        rounded = [float(f"{each:.4g}") for each in ends]  # more digits differ between processors
        return self.used.setdefault(name, Figure(*rounded)._replace(n=n))


def read_summary(folder: Path) -> dict[str, Figure]:
    """Return the figures that a folder of results keeps."""
    form = dict[str, tuple[float, float | None, float | None, int]]
    content = read_yaml(folder / SUMMARY, form, "summary of figures").value
    return {name: Figure(*figure) for name, figure in content.items()}


def differences(kept: Mapping[str, Figure], other: Mapping[str, Figure]) -> list[str]:
    """Return the figures that do not reproduce: their intervals share no value."""
    found = []
    for name, one in kept.items():
        two = other.get(name)
        if two is None:
            found.append(f"{name}: was {one.value:g}, is not measured")
        elif None in {one.low, two.low}:
            continue  # the extreme of other flights is another one
        elif one.high < two.low or two.high < one.low:
            found.append(f"{name}: was {one[:3]}, is {two[:3]} (value, low, high)")
    return found
