"""The report's figures of outcomes, of the distributions of metrics, and of coverage over time."""

from __future__ import annotations

import io
import math
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal, cast

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.report.paper import paper_figures
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import (
    success_interval,
    success_words,
    successes,
    values_of,
)
from uav_bt.mission.flight_report import EXPLORE_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito: distinguishable for people with colour-blindness. Dark colours first, on white.
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#555555")
_INK: Final = "#212529"
_GRID: Final = "#e9ecef"
_FONT: Final = "DejaVu Sans"  # part of matplotlib: the same image on each machine
_STYLE: Final[dict[str, Any]] = {
    "font.family": _FONT,
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
    with style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # `find_letters` names them
        metadata = dict.fromkeys(_NO_METADATA[form])
        figure.savefig(buffer, format=form, metadata=metadata, dpi="figure")
    return buffer.getvalue()


def find_letters(figure: Figure) -> set[str]:
    """Give texts the installed fonts that have their letters; return letters that no font has."""
    missing = set()
    for text in figure.findobj(Text):
        fonts = {letter: _font_with(letter) for letter in text.get_text() if letter.isprintable()}
        others = {font for font in fonts.values() if font and font != _FONT}
        text.set_fontfamily([_FONT, *sorted(others)])
        missing |= {letter for letter, font in fonts.items() if font is None}
    return missing


@cache
def _font_with(letter: str) -> str | None:
    """Return the name of a font that has a letter: matplotlib's own before those of the system."""
    real = (
        font for font in fontManager.ttflist if not font.name.startswith("Last Resort")
    )  # boxes
    fonts = sorted(real, key=lambda font: (font.name != _FONT, font.name))
    return next((f.name for f in fonts if get_font(f.fname).get_char_index(ord(letter))), None)


def _coloured(sets: Sequence[FlightSet]) -> list[tuple[FlightSet, str]]:
    return [(one, _COLOURS[index % len(_COLOURS)]) for index, one in enumerate(sets)]


def legend(figure: Figure, labels: Iterable[tuple[str, str]], columns: int = 2) -> None:
    """Add a legend of labels with their colours above a figure."""
    lines = [Line2D([], [], color=colour, label=label) for label, colour in labels]
    figure.legend(handles=lines, loc="outside upper left", ncols=columns)


def outcomes(sets: Sequence[FlightSet]) -> Figure:
    """Draw the share of successes of each set, with its 95 % Wilson interval."""
    with style():
        figure = new_figure(8.0, 0.8 + 0.55 * len(sets))
        axes = figure.add_subplot()
        for row, (one, colour) in enumerate(_coloured(sets)):
            low, high = success_interval(one.flights)
            axes.plot([low, high], [row, row], color=colour, linewidth=6, alpha=0.3)
            share = 100.0 * successes(one.flights) / len(one.flights)
            axes.plot(share, row, "o", color=colour, markersize=7, clip_on=False)
            # Above the bar: beside it, long labels would leave no room for the bars.
            words = f"{success_words(one.flights)}  [{low:.1f}, {high:.1f}]"
            for x, text, side in ((0.0, one.label, "left"), (100.0, words, "right")):
                place = {"xytext": (0, 7), "textcoords": "offset points"}
                axes.annotate(text, (x, row), **place, horizontalalignment=side)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        axes.set(xlim=(0.0, 100.0), ylim=(len(sets) - 0.6, -0.7))
        axes.set_xlabel("successful flights, %, with the 95 % Wilson interval")
        axes.grid(axis="x", color=_GRID)
        return figure


def distributions(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the cumulative distribution of each metric; None when no flight has a metric."""
    # Where all values are 0, no flight has that phase.
    panels = [name for name in METRICS if any(any(values_of(one.flights, name)) for one in sets)]
    if not panels:
        return None
    with style():
        rows = math.ceil(len(panels) / 2)
        figure = new_figure(9.5, 0.3 + 0.15 * len(sets) + 2.1 * rows)
        grid = figure.subplots(rows, 2, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, name in zip(grid.flat, panels, strict=False):
            _panel(axes, sets, name)
        legend(figure, ((one.label, colour) for one, colour in _coloured(sets)))
        return figure


def _panel(axes: Axes, sets: Sequence[FlightSet], name: str) -> None:
    metric, quoted = METRICS[name], paper_figures(name, (one.tree for one in sets))
    for _, least, most in quoted:
        axes.axvspan(least, most, color="#ffd43b", alpha=0.5, linewidth=0)
    for one, colour in _coloured(sets):
        if values := values_of(one.flights, name):
            axes.ecdf(values, color=colour, linewidth=1.8)
    title = f"{metric.words}, {metric.unit}" if metric.unit else metric.words
    axes.set_title("\n".join((title, *(f"paper, {text}" for text, _, _ in quoted))))
    axes.set(xlim=(0.0, 100.0) if metric.unit == "%" else (0.0, None), ylim=(0.0, 1.0))
    axes.set_yticks([0.0, 0.5, 1.0], ["0 %", "50 %", "100 %"])
    axes.grid(color=_GRID)


_SHARES: Final = ("passed", "seen")  # as the fields of a flight are called


def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the coverage of each flight over time and the mean of each set.

    Flights without measured coverage are left out; None when no flight has a curve.
    """
    measured = [
        (one.label, [f for f in one.flights if f.get("coverage_passed") is not None], colour)
        for one, colour in _coloured(sets)
    ]
    if not any(flight["coverage_curve"] for _, some, _ in measured for flight in some):
        return None
    with style():
        figure = new_figure(9.5, 3.4 + 0.15 * len(sets))
        panels = figure.subplots(1, len(_SHARES), sharey=True)
        for axes, what in zip(panels, _SHARES, strict=True):
            for _, some, colour in measured:
                alpha = float(np.clip(4.0 / max(len(some), 1), 0.1, 0.5))
                for flight in some:
                    curve = curve_of(flight, what)
                    axes.plot(*curve.T, color=colour, linewidth=0.8, alpha=alpha)
                    axes.plot(*curve[-1:].T, ".", color=colour, markersize=4, alpha=alpha)
                axes.plot(*mean_curve(some, what).T, color=colour, linewidth=2.0)
            axes.axvline(EXPLORE_S, color="#adb5bd", linewidth=0.8, linestyle=":")
            axes.set_title(f"free ground {'covered' if what == 'passed' else what}, %")
            axes.set_xlabel("time from the take-off command, s")
            axes.set(xlim=(0.0, None), ylim=(0.0, 100.0))
            axes.grid(color=_GRID)
        legend(
            figure,
            (
                (f"{label}, {len(some)} flight{'' if len(some) == 1 else 's'}", colour)
                for label, some, colour in measured
                if some
            ),
        )
        return figure


def curve_of(flight: Mapping[str, Any], what: str) -> NDArray[np.float64]:
    """Return a flight's coverage, `passed` or `seen`, to its end: time in s, share in %, (N, 2)."""
    column = 1 + _SHARES.index(what)
    points = [[point[0], 100.0 * point[column]] for point in flight["coverage_curve"]]
    end_s, share = flight.get("duration_s"), flight.get(f"coverage_{what}")
    if end_s is not None and share is not None and (not points or end_s > points[-1][0]):
        points.append([end_s, 100.0 * share])
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def mean_curve(flights: Sequence[Mapping[str, Any]], what: str) -> NDArray[np.float64]:
    """Return the mean coverage at the sample times that half of the flights reached, (N, 2).

    Time in s, share in %. Later the mean would jump whenever a flight ends.
    """
    column = 1 + _SHARES.index(what)
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
