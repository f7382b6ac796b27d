"""The report's figures of the scenes: flown paths and covered ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import cKDTree

from sim_bridge.twin.scene import Scene
from uav_bt.app.film import map_of_scene
from uav_bt.campaign.report.figures import legend, new_figure, style
from uav_bt.campaign.report.sources import Flights, FlightSet
from uav_bt.campaign.report.statistics import SUCCESS
from uav_bt.display.lab_map import LabMap
from uav_bt.mission.covered_ground import PASSED_M, GroundCells
from uav_bt.types.arrays import Flags

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    """Draw the flights in a scene: paths on the left, coverage on the right, a row for each set.

    Sets without paths in this scene are left out; None when no path was kept.
    """
    found = (
        (one, [f for f in one.flights if f["scene"] == name and f.get("path")]) for one in sets
    )
    rows = [(one, flown) for one, flown in found if flown]
    if not rows:
        return None
    lab, cells = map_of_scene(scene), GroundCells(scene.ground_plan)
    shown = [flight for _, flown in rows for flight in flown]
    paths_m = np.concatenate([np.asarray(flight["path"])[:, 1:3] for flight in shown])
    half_m = np.maximum(np.abs(paths_m).max(axis=0), np.asarray(lab.ground.size_m) / 2) + _MARGIN_M
    with style():
        row_in = _PANEL_IN * half_m[1] / half_m[0] + _WORDS_IN
        figure = new_figure(11.0, row_in * len(rows) + 0.4)
        grid = figure.subplots(len(rows), 2, squeeze=False, sharex=True, sharey=True)
        grid[0, 0].set(xlim=(-half_m[0], half_m[0]), ylim=(-half_m[1], half_m[1]))
        for (left, right), (one, flown) in zip(grid, rows, strict=True):
            _paths(left, flown, lab)
            count = "1 flight" if len(flown) == 1 else f"{len(flown)} flights"
            left.set_title(f"{one.label}\nin {name}, {count}", fontweight="bold")
            image = _coverage(right, flown, lab, cells)
        bar = figure.colorbar(image, ax=grid, shrink=0.7 / len(rows), pad=0.01)
        bar.set_label("flights that covered it, %")
        bar.outline.set_visible(False)
        outcomes = {flight["outcome"] for flight in shown}
        legend(
            figure,
            ((o.replace("_", " "), c) for o, c in _OUTCOME_COLOURS.items() if o in outcomes),
            columns=len(_OUTCOME_COLOURS),
        )
        return figure


def _paths(axes: Axes, flown: Flights, lab: LabMap) -> None:
    _draw_lab(axes, lab)
    alpha = float(np.clip(6.0 / len(flown), 0.15, 0.8))
    # Failures on top: they are few and matter most.
    for flight in sorted(flown, key=lambda one: one["outcome"] != SUCCESS):
        _, x_m, y_m, _ = np.asarray(flight["path"], dtype=np.float64).T
        colour = _OUTCOME_COLOURS[flight["outcome"]]
        if flight["outcome"] == SUCCESS:
            axes.plot(x_m, y_m, color=colour, linewidth=0.9, alpha=alpha)
        else:
            axes.plot(x_m, y_m, color=colour, linewidth=1.4, alpha=0.9)
            axes.plot(x_m[-1], y_m[-1], "x", color=colour, markersize=8, markeredgewidth=2)
        axes.plot(x_m[0], y_m[0], ".", color=colour, markersize=3)


def _coverage(axes: Axes, flown: Flights, lab: LabMap, cells: GroundCells) -> Any:
    _draw_lab(axes, lab)
    passed = [visited_cells(flight["path"], cells) for flight in flown]
    half_x, half_y = lab.ground.size_m[0] / 2, lab.ground.size_m[1] / 2
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
    """Draw ground, mark, boxes with their heights, movers' paths and take-off, with axes in m."""
    axes.add_patch(Polygon(lab.ground.corners_m, facecolor="none", edgecolor="#adb5bd"))
    if lab.mark is not None:
        axes.add_patch(Polygon(lab.mark.corners(), facecolor="white", edgecolor=_MARK))
        axes.text(lab.mark.x_m, lab.mark.y_m, "H", ha="center", va="center", color=_MARK)
    for box in lab.boxes:
        face = tuple(channel / 255 for channel in box.colour)
        axes.add_patch(Polygon(box.corners(), facecolor=face, edgecolor=_INK, linewidth=0.8))
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
