"""The report's figures of the lab: flown paths, and the carpet they covered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from uav_bt.campaign.report.figures import OUTCOME_COLOURS, new_figure, png, style
from uav_bt.campaign.report.sources import FlightSet
from uav_bt.display.lab_map import LabMap, MapItem

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELL_M: Final = 0.25  # divides the carpet's 5 m and 4 m
REACH_M: Final = 0.25  # half the drone's width and a bit: what it has been over
_STEP_M: Final = 0.05  # between points of the path that are looked at
_CARPET: Final = "#f1f3f0"
_INK_PAD: Final = "#a61e1e"
_MARGIN_M: Final = 0.35
_SUCCESS: Final = "success"

Flights = Sequence[dict[str, Any]]
Cells = NDArray[np.bool_]


def _flights_in(one: FlightSet, scene: str) -> list[dict[str, Any]]:
    """Return a set's flights in a scene whose path was kept."""
    return [flight for flight in one.flights if flight["scene"] == scene and flight.get("path")]


def _covered_shares(flights: Flights, lab: LabMap) -> list[float]:
    """Return which share of the carpet that is free of boxes each flight has been over, 0 to 1."""
    free = free_cells(lab)
    return [
        float((visited_cells(flight["path"], lab.carpet_size_m) & free).sum() / free.sum())
        for flight in flights
    ]


def scene_figure(sets: Sequence[FlightSet], scene: str, lab: LabMap) -> bytes | None:
    """Draw what happened in a scene: paths on the left, coverage beside, a row for each set.

    Args:
        sets: what is compared; those without kept paths in this scene are left out.
        scene: its name.
        lab: what stands there.

    Returns:
        A PNG; None when no path was kept.
    """
    rows = [(one, flown) for one in sets if (flown := _flights_in(one, scene))]
    if not rows:
        return None
    with style():
        figure = new_figure(11.0, 4.6 * len(rows) + 0.4)
        grid = figure.subplots(len(rows), 2, squeeze=False)
        for row, (one, flown) in enumerate(rows):
            _paths(grid[row, 0], flown, lab)
            count = "1 flight" if len(flown) == 1 else f"{len(flown)} flights"
            title = f"{one.label}\nin {scene}, {count}"
            grid[row, 0].set_title(title, fontweight="bold")
            image = _coverage(grid[row, 1], flown, lab)
        bar = figure.colorbar(image, ax=grid, shrink=0.7 / len(rows), pad=0.01)
        bar.set_label("flights that came by, %")
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
        return png(figure)


def _paths(axes: Axes, flown: Flights, lab: LabMap) -> None:
    _lab(axes, lab)
    alpha = float(np.clip(6.0 / len(flown), 0.15, 0.8))
    # Failures on top, for they are few and what one looks for.
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


def _coverage(axes: Axes, flown: Flights, lab: LabMap) -> Any:
    _lab(axes, lab, filled=False)
    seen = np.mean([visited_cells(f["path"], lab.carpet_size_m) for f in flown], axis=0)
    half_x, half_y = lab.carpet_size_m[0] / 2, lab.carpet_size_m[1] / 2
    image = axes.imshow(
        100.0 * seen,
        origin="lower",
        extent=(-half_x, half_x, -half_y, half_y),
        vmin=0.0,
        vmax=100.0,
        cmap="Blues",
        zorder=0,
    )
    shares = [100.0 * share for share in _covered_shares(flown, lab)]
    title = f"a flight covers {float(np.mean(shares)):.0f} % of the free carpet"
    spread = f" ({min(shares):.0f} to {max(shares):.0f} %)" if len(shares) > 1 else ""
    axes.set_title(title + spread)
    axes.set_xlabel(f"cells of {CELL_M:g} m, covered when passed within {REACH_M:g} m", fontsize=8)
    return image


def _lab(axes: Axes, lab: LabMap, *, filled: bool = True) -> None:
    half_x, half_y = lab.carpet_size_m[0] / 2, lab.carpet_size_m[1] / 2
    carpet = MapItem(x_m=0.0, y_m=0.0, size_m=(*lab.carpet_size_m, 0.0))
    axes.add_patch(
        Polygon(carpet.corners(), facecolor=_CARPET if filled else "none", edgecolor="#adb5bd")
    )
    if lab.helipad is not None:
        pad = lab.helipad
        axes.add_patch(Polygon(pad.corners(), facecolor="none", edgecolor=_INK_PAD, linewidth=1.4))
        axes.text(
            *(pad.x_m, pad.y_m, "H"),
            ha="center",
            va="center",
            weight="bold",
            color=_INK_PAD,
        )
    for box in lab.boxes:
        face = tuple(channel / 255 for channel in box.colour)
        axes.add_patch(Polygon(box.corners(), facecolor=face, edgecolor="#343a40", linewidth=0.8))
        axes.text(
            *(box.x_m, box.y_m, f"{box.size_m[2]:.1f}"),
            ha="center",
            va="center",
            fontsize=7,
            color="white",
        )
    axes.set_aspect("equal")
    axes.set_xlim(-half_x - _MARGIN_M, half_x + _MARGIN_M)
    axes.set_ylim(-half_y - _MARGIN_M, half_y + _MARGIN_M)
    axes.tick_params(length=2, labelsize=7)
    for spine in axes.spines.values():
        spine.set_visible(False)


# --- coverage -------------------------------------------------------------------------------------


def _centres(size_m: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the cells' centres in world metres, rows along y upwards: two (rows, columns)."""
    columns, rows = (max(1, round(side / CELL_M)) for side in size_m)
    x = (np.arange(columns) + 0.5) * size_m[0] / columns - size_m[0] / 2
    y = (np.arange(rows) + 0.5) * size_m[1] / rows - size_m[1] / 2
    return tuple(np.meshgrid(x, y))  # type: ignore[return-value]


def visited_cells(path: Sequence[Sequence[float]], carpet_size_m: tuple[float, float]) -> Cells:
    """Return the cells of the carpet whose centre a flight came within `REACH_M` of.

    Args:
        path: points (t, x, y, z), world metres; the path between two of them is straight.
        carpet_size_m: along world x and y.

    Returns:
        (rows, columns), rows along y upwards, columns along x.
    """
    x, y = _centres(carpet_size_m)
    if not path:
        return np.zeros(x.shape, dtype=np.bool_)
    corners = np.asarray(path, dtype=np.float64)[:, 1:3]
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(np.arange(0.0, along[-1], _STEP_M), along[-1])
    track = np.stack([np.interp(places, along, corners[:, axis]) for axis in (0, 1)], axis=1)
    cells = np.stack([x.ravel(), y.ravel()], axis=1)
    nearest_m2 = np.full(len(cells), np.inf)
    for chunk in np.array_split(track, max(1, len(track) // 256)):
        apart_m2 = ((cells[:, None] - chunk[None]) ** 2).sum(axis=2)
        nearest_m2 = np.minimum(nearest_m2, apart_m2.min(axis=1, initial=np.inf))
    return np.asarray(nearest_m2.reshape(x.shape) <= REACH_M**2)


def free_cells(lab: LabMap) -> Cells:
    """Return the cells of the carpet on which no box stands; (rows, columns), as above."""
    x, y = _centres(lab.carpet_size_m)
    free = np.ones(x.shape, dtype=np.bool_)
    for box in lab.boxes:
        free &= ~_inside(box, x, y)
    return free


def _inside(item: MapItem, x: NDArray[np.float64], y: NDArray[np.float64]) -> Cells:
    c, s = np.cos(item.yaw_rad), np.sin(item.yaw_rad)
    dx, dy = x - item.x_m, y - item.y_m
    along_x, along_y = c * dx + s * dy, -s * dx + c * dy
    return np.asarray(
        (np.abs(along_x) <= item.size_m[0] / 2) & (np.abs(along_y) <= item.size_m[1] / 2)
    )
