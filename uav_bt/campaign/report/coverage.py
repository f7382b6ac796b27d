"""How much of the carpet a flight has been over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.display.lab_map import LabMap, MapItem

__all__ = ["CELL_M", "REACH_M", "free_cells", "visited_cells"]

CELL_M: Final = 0.25  # divides the carpet's 5 m and 4 m
REACH_M: Final = 0.25  # half the drone's width and a bit: what it has been over
_STEP_M: Final = 0.05  # between points of the way that are looked at

Cells = NDArray[np.bool_]


def _centres(size_m: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the cells' centres in world metres, rows along y upwards: two (rows, columns)."""
    columns, rows = (max(1, round(side / CELL_M)) for side in size_m)
    x = (np.arange(columns) + 0.5) * size_m[0] / columns - size_m[0] / 2
    y = (np.arange(rows) + 0.5) * size_m[1] / rows - size_m[1] / 2
    return tuple(np.meshgrid(x, y))  # type: ignore[return-value]


def visited_cells(path: Sequence[Sequence[float]], carpet_size_m: tuple[float, float]) -> Cells:
    """Return the cells of the carpet whose centre a flight came within `REACH_M` of.

    Args:
        path: points (t, x, y, z), world metres; the way between two of them is straight.
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
    way = np.stack([np.interp(places, along, corners[:, axis]) for axis in (0, 1)], axis=1)
    cells = np.stack([x.ravel(), y.ravel()], axis=1)
    nearest_m2 = np.full(len(cells), np.inf)
    for chunk in np.array_split(way, max(1, len(way) // 256)):
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
