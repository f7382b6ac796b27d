"""The report's figures of numbers: outcomes with their intervals, densities side by side."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from uav_bt.campaign.report.paper import PAPER
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.campaign.report.statistics import bandwidth, density, summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's, distinguishable to everybody; darker first, for they lie on white.
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
_DIM: Final = "#868e96"
_ENOUGH: Final = 5  # different values that make a density worth drawing

DENSITIES: Final = {
    "time_to_find_helipad_s": "time to find the helipad, s",
    "time_to_land_s": "time from there to motors off, s",
    "explore_distance_m": "distance in the first 90 s, m",
    "search_distance_m": "distance while searching, m",
}
"""The paper's four density plots, in its order: field, and what stands under the axis."""

_STYLE: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same image everywhere
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
    "text.parse_math": False,  # names and reasons are plain texts, dollar signs included
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure in the report's style; draw and save it within `style()`."""
    return Figure(figsize=(width_in, height_in), dpi=130, layout="constrained", facecolor="white")


def style() -> Any:
    """Return the context in which the report's figures are drawn."""
    return mpl.rc_context(cast("Any", _STYLE))  # its stub lists all names there are


def png(figure: Figure) -> bytes:
    """Return a figure as PNG; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(  # type: ignore[no-untyped-call]
        buffer, metadata={"Software": None}
    )
    return buffer.getvalue()


def outcomes(sets: Sequence[FlightSet]) -> bytes:
    """Draw the share of successes of each set, with its 95 % Wilson interval; a PNG."""
    with style():
        figure = new_figure(8.0, 0.9 + 0.42 * len(sets))
        axes = figure.add_subplot()
        for row, (one, colour) in enumerate(zip(sets, _colours(sets), strict=True)):
            summary = summarise(one.flights)
            low, high = (100.0 * end for end in summary.success_95)
            axes.plot(
                [low, high], [row, row], color=colour, linewidth=6, alpha=0.3, solid_capstyle="butt"
            )
            axes.plot(100.0 * summary.success, row, "o", color=colour, markersize=7, clip_on=False)
            axes.annotate(
                f"{100.0 * summary.success:.1f} %  [{low:.1f}, {high:.1f}]  n = {summary.flights}",
                (0.0, row),
                xytext=(1.01, row),
                textcoords=("axes fraction", "data"),
                verticalalignment="center",
            )
        axes.set_yticks(range(len(sets)), [one.label for one in sets])
        axes.set_ylim(len(sets) - 0.5, -0.5)
        axes.set_xlim(0.0, 101.0)
        axes.set_xlabel("successful flights, %, with the 95 % Wilson interval")
        axes.grid(axis="x", color="#e9ecef")
        axes.set_axisbelow(True)
        axes.tick_params(axis="y", length=0)
        return png(figure)


def _colours(sets: Sequence[FlightSet]) -> list[str]:
    return [SET_COLOURS[index % len(SET_COLOURS)] for index in range(len(sets))]


def densities(sets: Sequence[FlightSet]) -> bytes:
    """Draw the paper's four density plots, all sets in each; a PNG."""
    with style():
        figure = new_figure(9.5, 6.4)
        grid = figure.subplots(2, 2)
        for axes, (field, words) in zip(grid.flat, DENSITIES.items(), strict=True):
            _density(axes, sets, field)
            axes.set_xlabel(words)
        handles = {
            text: handle
            for axes in grid.flat
            for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        if handles:
            figure.legend(list(handles.values()), list(handles), loc="outside upper left", ncols=2)
        return png(figure)


def _density(axes: Axes, sets: Sequence[FlightSet], field: str) -> None:
    reached = [[f[field] for f in one.flights if f.get(field) is not None] for one in sets]
    most = max((max(values) for values in reached if values), default=1.0)
    most = max([most, *(figure.span[1] for figure in PAPER.get(field, ()))])
    at = np.linspace(0.0, 1.08 * most or 1.0, 500)
    top = 0.0
    for one, values, colour in zip(sets, reached, _colours(sets), strict=True):
        if not values:
            continue
        # A few flights have no shape to speak of, and a narrow kernel is a spike that hides all.
        drawable = len(set(values)) >= _ENOUGH and bandwidth(values) > most / 400.0
        if drawable:
            curve = density(values, at)
            axes.fill_between(at, curve, color=colour, alpha=0.12, linewidth=0)
            axes.plot(at, curve, color=colour, label=one.label, linewidth=1.8)
            top = max(top, float(curve.max()))
        else:
            axes.axvline(float(np.median(values)), color=colour, label=one.label, linewidth=1.8)
    _rugs(axes, reached, _colours(sets), below=0.94 - 0.09 * len(PAPER.get(field, ())))
    axes.set_xlim(0.0, at[-1])
    axes.set_ylim(0.0, 1.25 * top or 1.0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    for row, figure in enumerate(PAPER.get(field, ())):
        axes.axvspan(*figure.span, color="#ffd43b", alpha=0.5, linewidth=0, zorder=0)
        late = figure.span[0] > 0.6 * at[-1]
        axes.annotate(
            f"paper, {figure.text}",
            (figure.span[0] if late else figure.span[1], 0.97 - 0.09 * row),
            xycoords=("data", "axes fraction"),
            xytext=(-4 if late else 4, 0),
            textcoords="offset points",
            horizontalalignment="right" if late else "left",
            verticalalignment="top",
            color="#7c5e00",
            fontsize=8,
        )
    if not any(reached):
        axes.text(
            0.5, 0.5, "no flight came so far", transform=axes.transAxes, ha="center", color=_DIM
        )


def _rugs(
    axes: Axes, reached: Sequence[Sequence[float]], colours: Sequence[str], *, below: float
) -> None:
    """Mark every flight under the curve, and say how many there are, from a height downwards."""
    for row, (values, colour) in enumerate(zip(reached, colours, strict=True)):
        axes.plot(
            values,
            np.full(len(values), 0.012 + 0.03 * row),
            "|",
            color=colour,
            alpha=0.5,
            markersize=5,
            transform=axes.get_xaxis_transform(),
        )
        text = f"n = {len(values)}"
        if values:
            text += f", median {np.median(values):.1f}"
        axes.annotate(
            text,
            (1.0, below - 0.08 * row),
            xycoords="axes fraction",
            horizontalalignment="right",
            color=colour,
            fontsize=8,
        )
