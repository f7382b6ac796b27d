"""The report's figures of the scenes: flown paths and covered ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from uav_bt.campaign.report.figures import OUTCOME_COLOURS, new_figure, style
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.display.lab_map import LabMap
from uav_bt.mission.covered_ground import PASSED_M, GroundCells
from uav_bt.types.arrays import Flags
from uav_bt.types.ground import Footprint, Ground, Standing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STEP_M: Final = 0.1  # between the evaluated points of a path; a tick's flight at 1 m/s
_GROUND: Final = "#f1f3f0"
_INK_PAD: Final = "#a61e1e"
_INK_NAME: Final = "#343a40"
_HALO: Final = (withStroke(linewidth=2.0, foreground="white"),)  # readable on dark cells
_ARROW_M: Final = 0.5  # length of the arrow of the take-off heading
_MARGIN_M: Final = 0.1  # around the ground and the paths
_PANEL_IN: Final = 4.7  # width of a panel's axes
_WORDS_IN: Final = 0.9  # height of the title, the ticks and their label
_SUCCESS: Final = "success"

Flights = Sequence[dict[str, Any]]


def _flights_in(one: FlightSet, scene: str) -> list[dict[str, Any]]:
    """Return a set's flights in a scene whose path was kept."""
    return [flight for flight in one.flights if flight["scene"] == scene and flight.get("path")]


def scene_figure(sets: Sequence[FlightSet], scene: str, lab: LabMap) -> Figure | None:
    """Draw the flights in a scene: paths on the left, coverage on the right, a row for each set.

    Args:
        sets: The flights. Sets without paths in this scene are left out.
        scene: Name of the scene.
        lab: Map of the scene.

    Returns:
        The figure; None when no path was kept.
    """
    rows = [(one, flown) for one in sets if (flown := _flights_in(one, scene))]
    if not rows:
        return None
    with style():
        half_x, half_y = _half_view_m(lab, [flight for _, flown in rows for flight in flown])
        row_in = _PANEL_IN * half_y / half_x + _WORDS_IN
        figure = new_figure(11.0, row_in * len(rows) + 0.4)
        grid = figure.subplots(len(rows), 2, squeeze=False, sharex=True, sharey=True)
        grid[0, 0].set(xlim=(-half_x, half_x), ylim=(-half_y, half_y))
        for row, (one, flown) in enumerate(rows):
            _paths(grid[row, 0], flown, lab)
            count = "1 flight" if len(flown) == 1 else f"{len(flown)} flights"
            title = f"{one.label}\nin {scene}, {count}"
            grid[row, 0].set_title(title, fontweight="bold")
            image = _coverage(grid[row, 1], flown, lab)
        bar = figure.colorbar(image, ax=grid, shrink=0.7 / len(rows), pad=0.01)
        bar.set_label("flights that covered it, %")
        bar.outline.set_visible(False)
        shown = {flight["outcome"] for _, flown in rows for flight in flown}
        figure.legend(
            handles=[
                Line2D([], [], color=colour, label=outcome.replace("_", " "))
                for outcome, colour in OUTCOME_COLOURS.items()
                if outcome in shown
            ],
            loc="outside upper left",
            ncols=len(OUTCOME_COLOURS),
        )
        return figure


def _half_view_m(lab: LabMap, flown: Flights) -> tuple[float, float]:
    """Return half the width and height of the view: the ground, and paths that leave it."""
    paths_m = np.concatenate([np.asarray(flight["path"])[:, 1:3] for flight in flown])
    half_m = np.maximum(np.abs(paths_m).max(axis=0), np.asarray(lab.ground_size_m) / 2)
    return float(half_m[0]) + _MARGIN_M, float(half_m[1]) + _MARGIN_M


def _paths(axes: Axes, flown: Flights, lab: LabMap) -> None:
    _lab(axes, lab)
    alpha = float(np.clip(6.0 / len(flown), 0.15, 0.8))
    # Failures on top: they are few and matter most.
    for flight in sorted(flown, key=lambda one: one["outcome"] != _SUCCESS):
        path = np.asarray(flight["path"], dtype=np.float64)
        good = flight["outcome"] == _SUCCESS
        colour = OUTCOME_COLOURS[flight["outcome"]]
        axes.plot(
            path[:, 1],
            path[:, 2],
            color=colour,
            linewidth=0.9 if good else 1.4,
            alpha=alpha if good else 0.9,
        )
        axes.plot(path[0, 1], path[0, 2], ".", color=colour, markersize=3)
        if not good:
            axes.plot(path[-1, 1], path[-1, 2], "x", color=colour, markersize=8, markeredgewidth=2)
    axes.set_xlabel("x, m", fontsize=8)
    axes.set_ylabel("y, m", fontsize=8)


def _coverage(axes: Axes, flown: Flights, lab: LabMap) -> Any:
    _lab(axes, lab, filled=False)
    cells = GroundCells(ground_of(lab))
    passed = [visited_cells(flight["path"], cells) for flight in flown]
    half_x, half_y = lab.ground_size_m[0] / 2, lab.ground_size_m[1] / 2
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


def _lab(axes: Axes, lab: LabMap, *, filled: bool = True) -> None:
    axes.add_patch(
        Polygon(lab.outline(), facecolor=_GROUND if filled else "none", edgecolor="#adb5bd")
    )
    if lab.mark is not None:
        pad = lab.mark
        pad_face = "none" if filled else "white"
        axes.add_patch(
            Polygon(pad.corners(), facecolor=pad_face, edgecolor=_INK_PAD, linewidth=1.4)
        )
        axes.text(
            pad.x_m,
            pad.y_m,
            "H",
            ha="center",
            va="center",
            weight="bold",
            color=_INK_PAD,
        )
    for box in lab.boxes:
        face = tuple(channel / 255 for channel in box.colour)
        axes.add_patch(Polygon(box.corners(), facecolor=face, edgecolor="#343a40", linewidth=0.8))
        axes.text(
            box.x_m,
            box.y_m,
            f"{box.size_m[2]:.3g}",
            ha="center",
            va="center",
            fontsize=7,
            color="white",
        )
        lowest_m = min(y_m for _, y_m in box.corners())
        axes.annotate(
            box.name,
            (box.x_m, lowest_m),
            xytext=(0, -1),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=6,
            color=_INK_NAME,
            path_effects=_HALO,
        )
    for mover in lab.movers:
        colour = tuple(channel / 255 for channel in mover.item.colour)
        axes.plot(*zip(*mover.path_m, strict=True), color=colour, linewidth=0.8, linestyle=":")
    if lab.take_off is not None:
        axes.annotate(
            "",
            lab.take_off.to_world(_ARROW_M, 0.0),
            (lab.take_off.x_m, lab.take_off.y_m),
            arrowprops={
                "arrowstyle": "-|>",
                "color": _INK_NAME,
                "shrinkA": 0,
                "shrinkB": 0,
                "path_effects": _HALO,
            },
        )
    axes.set_xlabel("x, m", fontsize=8)
    axes.set_ylabel("y, m", fontsize=8)
    axes.set_aspect("equal")
    axes.tick_params(length=2, labelsize=7, labelbottom=True)
    for spine in axes.spines.values():
        spine.set_visible(False)


# --- coverage -------------------------------------------------------------------------------------


def ground_of(lab: LabMap) -> Ground:
    """Return the ground of a map."""
    if lab.ground is not None:
        return lab.ground
    items = lab.boxes if lab.mark is None else (*lab.boxes, lab.mark)
    return Ground(
        size_m=lab.ground_size_m,
        standing=tuple(
            Standing(
                footprint=Footprint(
                    x_m=item.x_m,
                    y_m=item.y_m,
                    yaw_rad=item.yaw_rad,
                    half_x_m=item.size_m[0] / 2,
                    half_y_m=item.size_m[1] / 2,
                ),
                height_m=item.size_m[2],
            )
            for item in items
        ),
    )


def visited_cells(path: Sequence[Sequence[float]], cells: GroundCells) -> Flags:
    """Return the cells that a flight has passed, (rows, columns).

    Args:
        path: Points (t, x, y, z) in s and world metres, connected by straight lines.
        cells: Cells of the ground.
    """
    passed = np.zeros_like(cells.free)
    if not path:
        return passed
    corners = np.asarray(path, dtype=np.float64)[:, 1:3]
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(np.arange(0.0, along[-1], _STEP_M), along[-1])
    for x_m, y_m in zip(*(np.interp(places, along, axis) for axis in corners.T), strict=True):
        cells.mark_passed(passed, x_m, y_m)
    return passed
