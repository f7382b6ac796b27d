"""The report's figure of coverage: how the passed and the seen share of the ground grow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from uav_bt.campaign.report.figures import new_figure, set_colours, style
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import PERCENTILE_FLIGHTS
from uav_bt.mission.covered_ground import CURVE_S
from uav_bt.mission.flight_report import EXPLORE_S

_PANELS: Final = ("passed", "seen")


def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw mean and spread of the coverage over time, all sets in each panel.

    Args:
        sets: what is compared; flights whose coverage was not measured are left out.

    Returns:
        The figure; None when no flight has a curve.
    """
    measured = [[f for f in one.flights if f.get("coverage_passed") is not None] for one in sets]
    steps = max((len(f["coverage_curve"]) for some in measured for f in some), default=0)
    if not steps:
        return None
    at = CURVE_S * np.arange(steps + 1)
    with style():
        figure = new_figure(9.5, 3.6)
        panels = figure.subplots(1, len(_PANELS), sharey=True)
        for axes, what in zip(panels, _PANELS, strict=True):
            for some, colour in zip(measured, set_colours(sets), strict=True):
                if some:
                    shares = 100.0 * np.array(
                        [curve_to_end(flight, what, steps) for flight in some]
                    )
                    flying = np.count_nonzero(np.isfinite(shares), axis=0)
                    enough = flying >= PERCENTILE_FLIGHTS
                    if enough.any():
                        low, high = np.nanpercentile(shares[:, enough], [5, 95], axis=0)
                        axes.fill_between(
                            at[enough], low, high, color=colour, alpha=0.12, linewidth=0
                        )
                    mean = np.nanmean(shares[:, flying > 0], axis=0)
                    axes.plot(at[flying > 0], mean, color=colour, linewidth=1.8)
            axes.axvline(EXPLORE_S, color="#adb5bd", linewidth=0.8, linestyle=":")
            axes.set_title(f"free ground {what}, %")
            axes.set_xlabel("from the take-off command, s")
            axes.set_xlim(0.0, at[-1])
            axes.set_ylim(0.0, 100.0)
            axes.grid(color="#e9ecef")
        figure.legend(
            handles=[
                Line2D([], [], color=colour, label=f"{one.label}, {len(some)} flights")
                for one, some, colour in zip(sets, measured, set_colours(sets), strict=True)
                if some
            ],
            loc="outside upper left",
            ncols=2,
        )
        return figure


def curve_to_end(flight: Mapping[str, Any], what: str, steps: int) -> NDArray[np.float64]:
    """Return a flight's share from 0 s on, (steps + 1,), 0 to 1; NaN after the flight's end.

    Args:
        flight: its line, with its coverage.
        what: `passed` or `seen`.
        steps: number of steps of `CURVE_S`.
    """
    column = 1 + _PANELS.index(what)
    curve = [point[column] for point in flight["coverage_curve"]]
    return np.array([0.0, *curve, *[np.nan] * (steps - len(curve))])
