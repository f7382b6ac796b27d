"""The report's figure of coverage: the covered and the seen share of the free ground over time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from uav_bt.campaign.report.figures import new_figure, set_colours, style
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.mission.flight_report import EXPLORE_S

_PANELS: Final = ("passed", "seen")  # as the fields of a flight are called
_TITLES: Final = {"passed": "covered", "seen": "seen"}


def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the coverage of each flight over time and the mean of each set.

    Args:
        sets: The flights. Flights without measured coverage are left out.

    Returns:
        The figure; None when no flight has a curve.
    """
    measured = [[f for f in one.flights if f.get("coverage_passed") is not None] for one in sets]
    if not any(flight["coverage_curve"] for some in measured for flight in some):
        return None
    with style():
        figure = new_figure(9.5, 3.4 + 0.15 * len(sets))
        panels = figure.subplots(1, len(_PANELS), sharey=True)
        for axes, what in zip(panels, _PANELS, strict=True):
            for some, colour in zip(measured, set_colours(sets), strict=True):
                alpha = float(np.clip(4.0 / max(len(some), 1), 0.1, 0.5))
                for flight in some:
                    curve = curve_of(flight, what)
                    axes.plot(*curve.T, color=colour, linewidth=0.8, alpha=alpha)
                    axes.plot(*curve[-1:].T, ".", color=colour, markersize=4, alpha=alpha)
                axes.plot(*mean_curve(some, what).T, color=colour, linewidth=2.0)
            axes.axvline(EXPLORE_S, color="#adb5bd", linewidth=0.8, linestyle=":")
            axes.set_title(f"free ground {_TITLES[what]}, %")
            axes.set_xlabel("time from the take-off command, s")
            axes.set_xlim(left=0.0)
            axes.set_ylim(0.0, 100.0)
            axes.grid(color="#e9ecef")
        figure.legend(
            handles=[
                Line2D([], [], color=colour, label=_label(one, len(some)))
                for one, some, colour in zip(sets, measured, set_colours(sets), strict=True)
                if some
            ],
            loc="outside upper left",
            ncols=2,
        )
        return figure


def _label(one: FlightSet, flights: int) -> str:
    return f"{one.label}, {flights} flight{'' if flights == 1 else 's'}"


def curve_of(flight: Mapping[str, Any], what: str) -> NDArray[np.float64]:
    """Return a flight's coverage from its first sample to its end: time in s, share in %, (N, 2).

    Args:
        flight: Its line, with its coverage.
        what: `passed` or `seen`.
    """
    column = 1 + _PANELS.index(what)
    points = [[point[0], 100.0 * point[column]] for point in flight["coverage_curve"]]
    end_s, share = flight.get("duration_s"), flight.get(f"coverage_{what}")
    if end_s is not None and share is not None and (not points or end_s > points[-1][0]):
        points.append([end_s, 100.0 * share])
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def mean_curve(flights: Sequence[Mapping[str, Any]], what: str) -> NDArray[np.float64]:
    """Return the mean coverage at the sample times that half of the flights reached, (N, 2).

    Later times are left out: there the mean would jump whenever a flight ends.

    Args:
        flights: Their lines, with their coverage.
        what: `passed` or `seen`.

    Returns:
        Time in s and share in %, in the order of time.
    """
    column = 1 + _PANELS.index(what)
    shares: dict[float, list[float]] = defaultdict(list)
    for flight in flights:
        for point in flight["coverage_curve"]:
            shares[point[0]].append(point[column])
    means = [
        [time_s, 100.0 * float(np.mean(some))]
        for time_s, some in sorted(shares.items())
        if 2 * len(some) >= len(flights)
    ]
    return np.array(means, dtype=np.float64).reshape(-1, 2)
