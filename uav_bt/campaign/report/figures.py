"""The report's figures of outcomes, of the distributions of metrics, and of coverage over time."""

from __future__ import annotations

import io
import math
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from uav_bt.campaign.flight_lines import METRICS
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.report.statistics import (
    paper_figures,
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
_FONT: Final = "DejaVu Sans"  # part of matplotlib: the same image on each machine
_STYLE: Final[Any] = {
    "font.family": _FONT,
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
    return mpl.rc_context(_STYLE)


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
    fonts = sorted(fontManager.ttflist, key=lambda font: (font.name != _FONT, font.name))
    has = (font.name for font in fonts if get_font(font.fname).get_char_index(ord(letter)))
    return next((name for name in has if not name.startswith("Last Resort")), None)  # only boxes


def _coloured(sets: Sequence[FlightSet]) -> list[tuple[FlightSet, str]]:
    return [(one, _COLOURS[index % len(_COLOURS)]) for index, one in enumerate(sets)]


def legend(figure: Figure, labels: Iterable[tuple[str, str]], columns: int = 2) -> None:
    """Add a legend of labels with their colours above a figure."""
    lines = [Line2D([], [], color=colour, label=label) for label, colour in labels]
    figure.legend(handles=lines, loc="outside upper left", ncols=columns)


def outcomes(sets: Sequence[FlightSet]) -> Figure:
    """Draw the share of successes of each set, with its 95 % Wilson interval."""
    with style():
        figure = new_figure(8.0, 0.8 + 0.4 * len(sets))
        axes = figure.add_subplot()
        for row, (one, colour) in enumerate(_coloured(sets)):
            share = 100.0 * successes(one.flights) / len(one.flights)
            axes.plot(
                success_interval(one.flights), (row, row), color=colour, linewidth=6, alpha=0.3
            )
            axes.plot(share, row, "o", color=colour, markersize=7, clip_on=False)
        labels = [f"{one.label}: {success_words(one.flights)}" for one in sets]
        axes.set_yticks(range(len(sets)), labels)
        axes.set(xlim=(0.0, 100.0), ylim=(len(sets) - 0.5, -0.5))
        axes.set_xlabel("successful flights, %, with the 95 % Wilson interval")
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


_SHARES: Final = ("passed", "seen")  # as the fields of a flight are called


def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the coverage of each flight over time and the mean of each set.

    Flights without measured coverage are left out; None when no flight has a curve.
    """
    found = (
        (one, colour, [f for f in one.flights if f.get("coverage_passed") is not None])
        for one, colour in _coloured(sets)
    )
    measured = [(one.label, some, colour) for one, colour, some in found if some]
    if not any(flight["coverage_curve"] for _, some, _ in measured for flight in some):
        return None
    with style():
        figure = new_figure(9.5, 3.4 + 0.15 * len(sets))
        panels = figure.subplots(1, len(_SHARES), sharey=True)
        for axes, what in zip(panels, _SHARES, strict=True):
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


def curve_of(flight: Mapping[str, Any], what: str) -> NDArray[np.float64]:
    """Return a flight's coverage, `passed` or `seen`, to its end: time in s, share in %, (N, 2)."""
    curve = np.array(flight["coverage_curve"], dtype=np.float64).reshape(-1, 1 + len(_SHARES))
    points = curve[:, [0, 1 + _SHARES.index(what)]]
    end_s, share = flight.get("duration_s"), flight.get(f"coverage_{what}")
    if end_s is not None and share is not None and end_s > max(points[:, 0], default=0.0):
        points = np.vstack([points, (end_s, share)])
    return points * (1.0, 100.0)


def mean_curve(flights: Flights, what: str) -> NDArray[np.float64]:
    """Return the mean coverage at the sample times that half of the flights reached, (N, 2).

    Time in s, share in %. Later the mean would jump whenever a flight ends.
    """
    shares = defaultdict(list)
    for flight in flights:
        for point in flight["coverage_curve"]:
            shares[point[0]].append(100.0 * point[1 + _SHARES.index(what)])
    half = len(flights) / 2
    return np.array(
        [(t, np.mean(some)) for t, some in sorted(shares.items()) if len(some) >= half]
    ).reshape(-1, 2)
