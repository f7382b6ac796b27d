"""The report's figures of outcomes, of the distributions of metrics, and of coverage over time."""

from __future__ import annotations

import io
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from uav_bt.campaign.report import statistics as stats
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.store import METRICS
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.types.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito: distinguishable for people with colour-blindness. Dark colours first, on white.
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#555555")
STYLE: Final[Any] = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e9ecef",
    "legend.frameon": False,
    "text.parse_math": False,  # names and reasons are plain text and may contain dollar signs
    "pdf.fonttype": 42,  # TrueType: publishers refuse matplotlib's default, Type 3
    "svg.hashsalt": "uav-bt",  # otherwise the identifiers in an SVG are random
}
"""The report's figures are made and drawn with these settings of matplotlib."""

Form = Literal["png", "pdf", "svg"]

# Fields of a file's metadata that change with the time or with matplotlib's version.
_NO_METADATA: Final[dict[Form, tuple[str, ...]]] = {
    "png": ("Software",),
    "pdf": ("CreationDate", "Creator", "Producer"),
    "svg": ("Date", "Creator"),
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure."""
    return Figure(figsize=(width_in, height_in), dpi=130, layout="constrained", facecolor="white")


@mpl.rc_context(STYLE)
def drawn(figure: Figure, form: Form) -> bytes:
    """Return a figure as the content of an image file; equal figures give equal bytes."""
    buffer = io.BytesIO()
    metadata = dict.fromkeys(_NO_METADATA[form])
    figure.savefig(buffer, format=form, metadata=metadata, dpi="figure")
    return buffer.getvalue()


def legend(figure: Figure, labels: Iterable[tuple[str, str]], columns: int = 2) -> None:
    """Add a legend of labels with their colours above a figure."""
    lines = [Line2D([], [], color=colour, label=label) for label, colour in labels]
    figure.legend(handles=lines, loc="outside upper left", ncols=columns)


def _colour(index: int) -> str:
    return _COLOURS[index % len(_COLOURS)]


@mpl.rc_context(STYLE)
def outcomes(sets: Sequence[FlightSet]) -> Figure:
    """Draw the share of successes of each set, with its 95 % Wilson interval."""
    figure = new_figure(8.0, 0.8 + 0.4 * len(sets))
    axes = figure.add_subplot()
    for row, one in enumerate(sets):
        share = 100.0 * stats.successes(one.flights) / len(one.flights)
        ends = stats.success_interval(one.flights)
        axes.plot(ends, (row, row), color=_colour(row), linewidth=6, alpha=0.3)
        axes.plot(share, row, "o", color=_colour(row), markersize=7, clip_on=False)
    labels = [f"{one.label}: {stats.success_words(one.flights)}" for one in sets]
    axes.set_yticks(range(len(sets)), labels)
    axes.set(xlim=(0.0, 100.0), ylim=(len(sets) - 0.5, -0.5))
    axes.set_xlabel("successful flights, %, with the 95 % Wilson interval")
    return figure


@mpl.rc_context(STYLE)
def distributions(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the cumulative distribution of each metric; None when no flight has a metric."""
    # Where all values are 0, no flight has that phase.
    panels = [
        name for name in METRICS if any(any(stats.values_of(one.flights, name)) for one in sets)
    ]
    if not panels:
        return None
    rows = math.ceil(len(panels) / 2)
    figure = new_figure(9.5, 0.3 + 0.15 * len(sets) + 2.1 * rows)
    grid = figure.subplots(rows, 2, squeeze=False)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes, name in zip(grid.flat, panels, strict=False):
        _panel(axes, sets, name)
    legend(figure, ((one.label, _colour(index)) for index, one in enumerate(sets)))
    return figure


def _panel(axes: Axes, sets: Sequence[FlightSet], name: str) -> None:
    metric, quoted = METRICS[name], stats.paper_figures(name, (one.tree for one in sets))
    for _, least, most in quoted:
        axes.axvspan(least, most, color="#ffd43b", alpha=0.5, linewidth=0)
    for index, one in enumerate(sets):
        if values := stats.values_of(one.flights, name):
            axes.ecdf(values, color=_colour(index), linewidth=1.8)
    title = f"{metric.words}, {metric.unit}" if metric.unit else metric.words
    axes.set_title("\n".join((title, *(f"paper, {text}" for text, _, _ in quoted))))
    axes.set(xlim=(0.0, 100.0) if metric.unit == "%" else (0.0, None), ylim=(0.0, 1.0))
    axes.set_yticks([0.0, 0.5, 1.0], ["0 %", "50 %", "100 %"])


_SHARES: Final = ("passed", "seen")  # as the fields of a flight are called


@mpl.rc_context(STYLE)
def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the coverage of each flight over time and the mean of each set.

    Flights without measured coverage are left out; None when no flight has a curve.
    """
    found = (
        (one.label, [f for f in one.flights if f.get("coverage_passed") is not None], _colour(row))
        for row, one in enumerate(sets)
    )
    measured = [(label, some, colour) for label, some, colour in found if some]
    if not any(flight["coverage_curve"] for _, some, _ in measured for flight in some):
        return None
    figure = new_figure(9.5, 3.4 + 0.15 * len(sets))
    for axes, what in zip(figure.subplots(1, len(_SHARES), sharey=True), _SHARES, strict=True):
        for _, some, colour in measured:
            alpha = float(np.clip(4.0 / len(some), 0.1, 0.5))
            for flight in some:
                curve = curve_of(flight, what)
                axes.plot(*curve.T, color=colour, linewidth=0.8, alpha=alpha)
                axes.plot(*curve[-1:].T, ".", color=colour, markersize=4, alpha=alpha)
            axes.plot(*mean_curve(some, what).T, color=colour, linewidth=2.0)
        axes.axvline(EXPLORE_S, color="#adb5bd", linewidth=0.8, linestyle=":")
        axes.set_title(f"free ground {'covered' if what == 'passed' else what}, %")
        axes.set_xlabel("time from the take-off command, s")
        axes.set(xlim=(0.0, None), ylim=(0.0, 100.0))
    legend(figure, ((f"{label}, flights: {len(some)}", c) for label, some, c in measured))
    return figure


def curve_of(flight: Mapping[str, Any], what: str) -> Floats:
    """Return a flight's coverage, `passed` or `seen`, to its end: time in s, share in %, (N, 2)."""
    curve = np.array(flight["coverage_curve"], dtype=np.float64).reshape(-1, 1 + len(_SHARES))
    points = curve[:, [0, 1 + _SHARES.index(what)]]
    end_s, share = flight.get("duration_s"), flight.get(f"coverage_{what}")
    if end_s is not None and share is not None and end_s > max(points[:, 0], default=0.0):
        points = np.vstack([points, (end_s, share)])
    return points * (1.0, 100.0)


def mean_curve(flights: Flights, what: str) -> Floats:
    """Return the mean coverage at the sample times that half of the flights reached, (N, 2).

    Time in s, share in %. Later the mean would jump whenever a flight ends.
    """
    shares = defaultdict(list)
    for flight in flights:
        for point in flight["coverage_curve"]:
            shares[point[0]].append(100.0 * point[1 + _SHARES.index(what)])
    half = len(flights) / 2
    means = [(t, np.mean(some)) for t, some in sorted(shares.items()) if len(some) >= half]
    return np.array(means).reshape(-1, 2)
