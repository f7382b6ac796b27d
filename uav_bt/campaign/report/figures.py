"""The report's figures: distributions, coverage, and paths in the scenes."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from scipy.spatial import cKDTree

from sim_bridge.twin.scene import Scene
from uav_bt.app.film import map_of_scene
from uav_bt.campaign.report import statistics as stats
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.store import METRICS
from uav_bt.display.lab_map import LabMap
from uav_bt.mission.covered_ground import PASSED_M, GroundCells
from uav_bt.mission.flight_report import EXPLORE_S
from uav_bt.types.arrays import Flags, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLE: Final[Any] = {
    # Okabe and Ito: for people with colour-blindness, too. Dark colours first, on white.
    "axes.prop_cycle": cycler(
        color=("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#555555")
    ),
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "figure.facecolor": "white",
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


def fonts_for(text: str) -> tuple[list[str], str]:
    """Return the families of fonts that have a text's letters, and the letters that none has."""
    families, letters = list(mpl.rcParams["font.family"]), {each for each in text if each > " "}
    for file in (findfont(FontProperties()), *(font.fname for font in fontManager.ttflist)):
        # Matplotlib's last resort has a box for every letter.
        if letters and "LastResort" not in file:
            font = get_font(file)
            has = set(map(chr, font.get_charmap()))
            if letters & has:
                families.append(font.family_name)
                letters -= has
    return list(dict.fromkeys(families)), "".join(sorted(letters))


def drawn(figure: Figure, form: Form) -> bytes:
    """Return a figure as the content of an image file; equal figures give equal bytes.

    It has the colours of `STYLE` if that is in force.
    """
    buffer = io.BytesIO()
    metadata = dict.fromkeys(_NO_METADATA[form])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # a note names them
        figure.savefig(buffer, format=form, metadata=metadata, dpi="figure")
    return buffer.getvalue()


def _legend(figure: Figure, labels: Iterable[tuple[str, str]], columns: int = 2) -> None:
    """Add a legend of labels with their colours above a figure."""
    lines = [Line2D([], [], color=colour, label=label) for label, colour in labels]
    figure.legend(handles=lines, loc="outside upper left", ncols=columns)


def distributions(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the cumulative distribution of each metric; None when no flight has a metric."""
    # Where all values are 0, no flight has that phase.
    panels = [
        name for name in METRICS if any(any(stats.values_of(one.flights, name)) for one in sets)
    ]
    if not panels:
        return None
    rows = math.ceil(len(panels) / 2)
    figure = Figure(figsize=(9.5, 0.3 + 0.15 * len(sets) + 2.1 * rows))
    grid = figure.subplots(rows, 2, squeeze=False)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes, name in zip(grid.flat, panels, strict=False):
        for index, one in enumerate(sets):
            if values := stats.values_of(one.flights, name):
                axes.ecdf(values, color=f"C{index}", linewidth=1.8)
        metric = METRICS[name]
        axes.set_title(f"{metric.words}, {metric.unit}" if metric.unit else metric.words)
        axes.set(xlim=(0.0, 100.0) if metric.unit == "%" else (0.0, None), ylim=(0.0, 1.0))
        axes.set_yticks([0.0, 0.5, 1.0], ["0 %", "50 %", "100 %"])
    _legend(figure, ((one.label, f"C{index}") for index, one in enumerate(sets)))
    return figure


_PERCENT: Final = (1.0, 100.0, 100.0)  # of time and two shares


def coverage_over_time(sets: Sequence[FlightSet]) -> Figure | None:
    """Draw the coverage of flights over time and each set's mean; None without a curve."""
    needed = ("coverage_passed", "coverage_curve")
    found = (
        (one.label, [f for f in one.flights if None not in map(f.get, needed)], f"C{row}")
        for row, one in enumerate(sets)
    )
    measured = [(label, some, colour) for label, some, colour in found if some]
    if not any(flight["coverage_curve"] for _, some, _ in measured for flight in some):
        return None
    figure = Figure(figsize=(9.5, 3.4 + 0.15 * len(sets)))
    panels = zip((1, 2), ("covered", "seen"), figure.subplots(1, 2, sharey=True), strict=True)
    for column, what, axes in panels:
        for _, some, colour in measured:
            alpha = float(np.clip(4.0 / len(some), 0.1, 0.5))
            for flight in some:
                curve = curve_of(flight)[:, [0, column]]
                axes.plot(*curve.T, color=colour, linewidth=0.8, alpha=alpha)
                axes.plot(*curve[-1:].T, ".", color=colour, markersize=4, alpha=alpha)
            axes.plot(*mean_curve(some)[:, [0, column]].T, color=colour, linewidth=2.0)
        axes.axvline(EXPLORE_S, color="#adb5bd", linewidth=0.8, linestyle=":")
        axes.set_title(f"free ground {what}, %")
        axes.set_xlabel("time from the take-off command, s")
        axes.set(xlim=(0.0, None), ylim=(0.0, 100.0))
    _legend(figure, ((f"{label}, flights: {len(some)}", c) for label, some, c in measured))
    return figure


def curve_of(flight: Mapping[str, Any]) -> Floats:
    """Return a flight's coverage: time in s, shares passed and seen in %, (N, 3)."""
    curve = np.array(flight["coverage_curve"], dtype=np.float64).reshape(-1, 3)
    end: list[Any] = [flight.get(f) for f in ("duration_s", "coverage_passed", "coverage_seen")]
    if None not in end and end[0] > max(curve[:, 0], default=0.0):
        curve = np.vstack([curve, end])
    return curve * _PERCENT


def mean_curve(flights: Flights) -> Floats:
    """Return the mean coverage at the sample times that half of the flights reached, (N, 3).

    Columns as in `curve_of`. Later the mean would jump whenever a flight ends.
    """
    curves = [point for flight in flights for point in flight["coverage_curve"]]
    points = np.array(curves, dtype=np.float64).reshape(-1, 3)
    times_s, counts = np.unique(points[:, 0], return_counts=True)
    kept_s = times_s[counts >= len(flights) / 2]
    means = [points[points[:, 0] == time_s].mean(axis=0) for time_s in kept_s]
    return np.reshape(means, (-1, 3)) * _PERCENT


_OUTCOME_COLOURS: Final = {
    "success": "#2b8a5a",
    "collision": "#c92a2a",
    "left_area": "#e67700",
    "timeout": "#6741d9",
    "aborted": "#868e96",
    "error": "#212529",
}
_POINTS: Final = 5  # that are evaluated for each of a path, one for each tick
_MARK: Final = "#a61e1e"
_INK: Final = "#343a40"
_ARROW_M: Final = 0.5  # length of the arrow of the take-off heading
_MARGIN_M: Final = 0.1  # around the ground and the paths
_PANEL_IN: Final = 4.7  # width of a panel's axes
_WORDS_IN: Final = 0.9  # height of the title, the ticks and their label


def scene_figure(sets: Sequence[FlightSet], name: str, scene: Scene) -> Figure | None:
    """Draw paths (left) and coverage (right) in a scene, a row for each set; None without paths."""
    found = (
        (one.label, [f for f in one.flights if f["scene"] == name and f.get("path")])
        for one in sets
    )
    rows = [(label, flown) for label, flown in found if flown]
    if not rows:
        return None
    lab, cells = map_of_scene(scene), GroundCells(scene.ground_plan)
    shown = [flight for _, flown in rows for flight in flown]
    paths_m = np.concatenate([np.asarray(flight["path"])[:, 1:3] for flight in shown])
    half_m = np.maximum(np.abs(paths_m).max(axis=0), np.asarray(lab.ground.size_m) / 2) + _MARGIN_M
    row_in = _PANEL_IN * half_m[1] / half_m[0] + _WORDS_IN
    figure = Figure(figsize=(11.0, row_in * len(rows) + 0.4))
    grid = figure.subplots(len(rows), 2, squeeze=False, sharex=True, sharey=True)
    grid[0, 0].set(xlim=(-half_m[0], half_m[0]), ylim=(-half_m[1], half_m[1]))
    for (left, right), (label, flown) in zip(grid, rows, strict=True):
        _draw_lab(left, lab)
        _draw_paths(left, flown)
        count = "1 flight" if len(flown) == 1 else f"{len(flown)} flights"
        left.set_title(f"{label}\nin {name}, {count}", fontweight="bold")
        _draw_lab(right, lab)
        image = _draw_coverage(right, flown, lab, cells)
    bar = figure.colorbar(image, ax=grid, shrink=0.7 / len(rows), pad=0.01)
    bar.set_label("flights that covered it, %")
    bar.outline.set_visible(False)
    outcomes = {flight["outcome"] for flight in shown}
    colours = ((o.replace("_", " "), c) for o, c in _OUTCOME_COLOURS.items() if o in outcomes)
    _legend(figure, colours, columns=len(_OUTCOME_COLOURS))
    return figure


def _draw_paths(axes: Axes, flown: Flights) -> None:
    alpha = float(np.clip(6.0 / len(flown), 0.15, 0.8))
    # Failures on top: they are few and matter most.
    for flight in sorted(flown, key=lambda one: one["outcome"] != stats.SUCCESS):
        _, x_m, y_m, _ = np.asarray(flight["path"], dtype=np.float64).T
        failed, colour = flight["outcome"] != stats.SUCCESS, _OUTCOME_COLOURS[flight["outcome"]]
        width, shade = (1.4, 0.9) if failed else (0.9, alpha)
        axes.plot(x_m, y_m, color=colour, linewidth=width, alpha=shade)
        if failed:
            axes.plot(x_m[-1], y_m[-1], "x", color=colour, markersize=8, markeredgewidth=2)
        axes.plot(x_m[0], y_m[0], ".", color=colour, markersize=3)


def _draw_coverage(axes: Axes, flown: Flights, lab: LabMap, cells: GroundCells) -> Any:
    passed = [visited_cells(flight["path"], cells) for flight in flown]
    half_x, half_y = (side / 2 for side in lab.ground.size_m)
    image = axes.imshow(
        100.0 * np.mean(passed, axis=0),
        origin="lower",
        extent=(-half_x, half_x, -half_y, half_y),
        vmin=0.0,
        vmax=100.0,
        cmap="Blues",
        zorder=0,
    )
    shares = [100.0 * cells.share(one) for one in passed]
    spread = f" (mean; {min(shares):.0f} to {max(shares):.0f} %)" if len(shares) > 1 else ""
    axes.set_title(f"{float(np.mean(shares)):.0f} % of the free ground covered{spread}")
    axes.set_xlabel(f"x, m; covered: the body's centre came within {PASSED_M:g} m", fontsize=8)
    return image


def _draw_lab(axes: Axes, lab: LabMap) -> None:
    """Draw ground, mark, boxes, movers' paths and take-off, with axes in m."""
    axes.add_patch(Polygon(lab.ground.corners_m, facecolor="none", edgecolor="#adb5bd"))
    if lab.mark is not None:
        axes.add_patch(Polygon(lab.mark.corners(), facecolor="white", edgecolor=_MARK))
        letter = "H" if lab.mark.picture is None else "mark"
        axes.text(lab.mark.x_m, lab.mark.y_m, letter, ha="center", va="center", color=_MARK)
    for box in lab.boxes:
        face = tuple(channel / 255 for channel in box.colour)
        for outline_m in box.pieces_m or (box.corners(),):
            axes.add_patch(Polygon(outline_m, facecolor=face, edgecolor=_INK, linewidth=0.8))
        height = f"{box.height_m:.3g}"
        axes.text(box.x_m, box.y_m, height, fontsize=7, color="white", ha="center", va="center")
    for mover in lab.movers:
        colour = tuple(channel / 255 for channel in mover.colour)
        axes.plot(*zip(*mover.path_m, strict=True), color=colour, linewidth=0.8, linestyle=":")
    if lab.take_off is not None:
        arrow = {"arrowstyle": "-|>", "color": _INK, "shrinkA": 0, "shrinkB": 0}
        ahead = lab.take_off.to_world(_ARROW_M, 0.0)
        axes.annotate("", ahead, (lab.take_off.x_m, lab.take_off.y_m), arrowprops=arrow)
    axes.set_xlabel("x, m", fontsize=8)
    axes.set_ylabel("y, m", fontsize=8)
    axes.set_aspect("equal")
    axes.tick_params(length=2, labelsize=7, labelbottom=True)
    axes.spines[:].set_visible(False)
    axes.grid(visible=False)


def visited_cells(path: Sequence[Sequence[float]], cells: GroundCells) -> Flags:
    """Return the cells that a flight has passed, (rows, columns).

    `path` has points (t, x, y, z) in s and world metres, connected by straight lines.
    """
    time_s, x_m, y_m, _ = np.asarray(path, dtype=np.float64).T
    dense_s = np.linspace(time_s[0], time_s[-1], _POINTS * len(path))
    points_m = np.column_stack([np.interp(dense_s, time_s, along_m) for along_m in (x_m, y_m)])
    away_m, _ = cKDTree(points_m).query(cells.middles_m)
    return np.asarray(away_m <= PASSED_M)
