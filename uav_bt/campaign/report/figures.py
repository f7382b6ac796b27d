"""The report's figures of outcomes with their intervals and of the densities of metrics."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, cast

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from uav_bt.campaign.flight_lines import METRICS, Metric
from uav_bt.campaign.report.paper import paper_figures
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import (
    Distribution,
    bandwidth,
    density,
    reached,
    summarise,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito: distinguishable for people with colour-blindness. Dark colours first, on white.
SET_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#555555")
OUTCOME_COLOURS: Final = {
    "success": "#2b8a5a",
    "collision": "#c92a2a",
    "left_area": "#e67700",
    "timeout": "#6741d9",
    "aborted": "#868e96",
    "error": "#212529",
}
_INK: Final = "#212529"
_ENOUGH: Final = 5  # smallest number of different values with a density (chosen)
_DIGITS: Final = (
    (1.0, 3),
    (10.0, 2),
)  # decimal places of numbers below; of others, and of s and %, one
_LINE_PT: Final = 11.0  # between lines of text above a panel

_STYLE: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",  # part of matplotlib: the same image on each machine
    "font.size": 9.0,
    "axes.edgecolor": "#adb5bd",
    "axes.labelcolor": _INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "text.color": _INK,
    "xtick.color": "#495057",
    "ytick.color": "#495057",
    "legend.frameon": False,
    "text.parse_math": False,  # names and reasons are plain text and may contain dollar signs
    "pdf.fonttype": 42,  # TrueType: publishers refuse matplotlib's default, Type 3
    "svg.hashsalt": "uav-bt",  # otherwise the identifiers in an SVG are random
}


Form = Literal["png", "pdf", "svg"]

# Fields of a file's metadata that change with the time or with matplotlib's version.
_NO_METADATA: Final[dict[Form, tuple[str, ...]]] = {
    "png": ("Software",),
    "pdf": ("CreationDate", "Creator", "Producer"),
    "svg": ("Date", "Creator"),
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure in the report's style; its parts are added within `style()`."""
    return Figure(figsize=(width_in, height_in), dpi=130, layout="constrained", facecolor="white")


def style() -> Any:
    """Return the context in which the report's figures are drawn."""
    return mpl.rc_context(cast("Any", _STYLE))  # its stub lists all names there are


def drawn(figure: Figure, form: Form) -> bytes:
    """Return a figure as the content of an image file; equal figures give equal bytes."""
    buffer = io.BytesIO()
    with style():
        metadata = dict.fromkeys(_NO_METADATA[form])
        figure.savefig(buffer, format=form, metadata=metadata, dpi="figure")
    return buffer.getvalue()


def outcomes(sets: Sequence[FlightSet]) -> Figure:
    """Draw the share of successes of each set, with its 95 % Wilson interval."""
    with style():
        figure = new_figure(8.0, 0.8 + 0.55 * len(sets))
        axes = figure.add_subplot()
        for row, (one, colour) in enumerate(zip(sets, set_colours(sets), strict=True)):
            summary = summarise(one.flights)
            low, high = (100.0 * end for end in summary.success_95)
            axes.plot(
                [low, high], [row, row], color=colour, linewidth=6, alpha=0.3, solid_capstyle="butt"
            )
            share = 100.0 * summary.successes / summary.flights
            axes.plot(share, row, "o", color=colour, markersize=7, clip_on=False)
            # Above the bar: beside it, long labels would leave no room for the bars.
            words = f"{summary.success_text}  [{low:.1f}, {high:.1f}]"
            for x, text, side in ((0.0, one.label, "left"), (100.0, words, "right")):
                axes.annotate(
                    text,
                    (x, row),
                    xytext=(0, 7),
                    textcoords="offset points",
                    horizontalalignment=side,
                )
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(sets) - 0.6, -0.7)
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("successful flights, %, with the 95 % Wilson interval")
        axes.grid(axis="x", color="#e9ecef")
        axes.set_axisbelow(True)
        return figure


def set_colours(sets: Sequence[FlightSet]) -> list[str]:
    """Return a colour for each set."""
    return [SET_COLOURS[index % len(SET_COLOURS)] for index in range(len(sets))]


def densities(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the distribution of each metric, all sets in each panel.

    Args:
        sets: The flights.

    Returns:
        The figure; None when no flight has a metric.
    """
    # Where all values are 0, no flight has that phase.
    panels = [name for name in METRICS if any(any(some) for some in _values(sets, name))]
    if not panels:
        return None
    with style():
        rows = math.ceil(len(panels) / 2)
        quoted = max(len(paper_figures(name, (one.tree for one in sets))) for name in panels)
        row_in = 1.9 + _LINE_PT / 72.0 * (len(sets) + quoted)
        figure = new_figure(9.5, 0.2 + 0.15 * len(sets) + row_in * rows)
        grid = figure.subplots(rows, 2, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, name in zip(grid.flat, panels, strict=False):
            _panel(axes, sets, name)
        figure.legend(
            handles=[
                Line2D([], [], color=colour, label=one.label, linewidth=1.8)
                for one, colour in zip(sets, set_colours(sets), strict=True)
            ],
            loc="outside upper left",
            ncols=2,
        )
        return figure


def _values(sets: Sequence[FlightSet], name: str) -> list[list[float]]:
    """Return the values of a metric, of the flights of each set that reached it."""
    return [
        [value for flight in one.flights if (value := reached(flight, name)) is not None]
        for one in sets
    ]


def _panel(axes: Axes, sets: Sequence[FlightSet], name: str) -> None:
    metric = METRICS[name]
    values, colours = _values(sets, name), set_colours(sets)
    published = paper_figures(name, (one.tree for one in sets))
    tail = 2.5 if metric.unit else 0.0  # bandwidths in view right of the largest value (chosen)
    ends = [max(some) + tail * bandwidth(some) for some in values if some]
    ends += [figure.span[1] for figure in published]
    end = 100.0 if metric.unit == "%" else 1.08 * max(ends) or 1.0
    at = np.linspace(0.0, end, 500)
    axes.set_xlim(0.0, at[-1])
    for figure in published:
        axes.axvspan(*figure.span, color="#ffd43b", alpha=0.5, linewidth=0, zorder=0)
    top = 0.0
    for row, (some, colour) in enumerate(zip(values, colours, strict=True)):
        if not some:
            continue
        # Few values and counts have no density; a narrow kernel is a spike that hides the others.
        if metric.unit and len(set(some)) >= _ENOUGH and bandwidth(some) > at[-1] / 432.0:
            curve = density(some, at)
            axes.fill_between(at, curve, color=colour, alpha=0.12, linewidth=0)
            axes.plot(at, curve, color=colour, linewidth=1.8)
            top = max(top, float(curve.max()))
            _marks(axes, some, 0.012 + 0.03 * row, marker="|", colour=colour)
        else:
            _marks(axes, some, 1.0 - (row + 0.5) / len(sets), marker="o", colour=colour)
    axes.set_ylim(0.0, 1.1 * top or 1.0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    lines = [
        (_in_words(some, metric), colour)
        for some, colour in zip(values, colours, strict=True)
        if some
    ]
    lines += [(f"paper, {figure.text}", "#7c5e00") for figure in published]
    _head(axes, metric.title, lines)


def _marks(axes: Axes, values: Sequence[float], height: float, *, marker: str, colour: str) -> None:
    """Mark every flight at a height of the panel, 0 to 1."""
    axes.plot(
        values,
        np.full(len(values), height),
        marker,
        color=colour,
        alpha=0.5,
        markersize=6,
        clip_on=False,
        transform=axes.get_xaxis_transform(),
    )


def _in_words(values: Sequence[float], metric: Metric) -> str:
    found = Distribution.of(values)
    if found is None or found.count == 1:
        return "1 flight: " + ", ".join(_number(value, metric) for value in values)
    least, median, most = (
        _number(value, metric) for value in (found.least, found.median, found.most)
    )
    return f"{found.count} flights: least {least}, median {median}, most {most}"


def _number(value: float, metric: Metric) -> str:
    if not value or not metric.unit:
        return f"{value:g}"
    digits = next((digits for end, digits in _DIGITS if value < end and metric.unit == "m"), 1)
    return f"{value:.{digits}f}"


def _head(axes: Axes, title: str, lines: Sequence[tuple[str, str]]) -> None:
    """Write a title and coloured lines above a panel, clear of the curves."""
    for index, (text, colour) in enumerate(reversed(lines)):
        axes.annotate(
            text,
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(0, 4 + _LINE_PT * index),
            textcoords="offset points",
            color=colour,
            fontsize=8,
        )
    axes.set_title(title, pad=8 + _LINE_PT * len(lines))
