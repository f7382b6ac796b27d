"""Points of the map as tables: columns of one length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.types.arrays import Flags, Floats, Indices


@dataclass(frozen=True, kw_only=True, eq=False)
class PointTable:
    """N points of a level plane; subclasses add columns.

    Attributes:
        xy_m: (N, 2) float64, in metres.
    """

    xy_m: Floats

    def __len__(self) -> int:
        return len(self.xy_m)

    def take(self, which: Flags | Indices) -> Self:
        """Return the chosen rows.

        Args:
            which: (N,) flags, or row numbers.
        """
        if which.dtype == np.bool_ and which.all():
            return self  # callers never write to columns
        rows = np.flatnonzero(which) if which.dtype == np.bool_ else which
        columns = vars(self).items()
        return type(self)(**{name: column.take(rows, axis=0) for name, column in columns})

    def with_rows(self, other: Self) -> Self:
        """Return this table with another's rows below."""
        mine, theirs = vars(self), vars(other)
        return type(self)(**{name: np.concatenate([mine[name], theirs[name]]) for name in mine})


def first_in_cells(xy_m: Floats, cell_m: float, *keys: NDArray[Any]) -> Indices:
    """Return the row of the first point in each cell of a grid, ordered by cell.

    Args:
        xy_m: (N, 2) points.
        cell_m: side of a cell.
        keys: columns, (N,), by which the points of a cell are sorted, the least important first.
            Points with equal keys keep their order.

    Returns:
        (C,) row numbers.
    """
    cells = np.floor(xy_m / cell_m).astype(np.int64)
    codes = (cells[:, 0] << 32) + cells[:, 1]
    order = np.lexsort((*keys, codes))
    codes = codes[order]
    begins = np.ones(len(codes), dtype=bool)
    np.not_equal(codes[1:], codes[:-1], out=begins[1:])
    return np.asarray(order[begins])


@compiled("intp[::1](float64[:, ::1], float64)")
def clusters(xy_m: Floats, apart_m: float) -> Indices:
    """Group points by single linkage.

    Args:
        xy_m: (N, 2) points.
        apart_m: a point this near to any point of a cluster belongs to it.

    Returns:
        (N,) number of each point's cluster from 0, in the order of their first points.
    """
    labels = np.full(len(xy_m), -1, dtype=np.intp)
    open_rows = np.empty(len(xy_m), dtype=np.intp)  # rows with unvisited neighbours
    label = -1
    for first in range(len(xy_m)):
        if labels[first] >= 0:
            continue
        label += 1
        labels[first], open_rows[0], count = label, first, 1
        while count:
            count -= 1
            here = open_rows[count]
            for row in range(first + 1, len(xy_m)):
                dx, dy = xy_m[row, 0] - xy_m[here, 0], xy_m[row, 1] - xy_m[here, 1]
                if labels[row] < 0 and math.sqrt(dx * dx + dy * dy) <= apart_m:
                    labels[row], open_rows[count] = label, row
                    count += 1
    return labels


@compiled("Tuple((float64[::1], intp[::1]))(float64[:, ::1], float64[:, ::1], float64[::1])")
def nearest_circles(xy_m: Floats, centres_m: Floats, radii_m: Floats) -> tuple[Floats, Indices]:
    """Find the nearest circle of each point.

    Args:
        xy_m: (N, 2) points.
        centres_m: (M, 2) centres of the circles.
        radii_m: (M,) radii; zeros for the distance to the centres.

    Returns:
        (N,) distance to the nearest circle, negative inside, infinite without circles; and (N,)
        row of that circle.
    """
    off_m = np.full(len(xy_m), np.inf)
    nearest = np.zeros(len(xy_m), dtype=np.intp)
    for point in range(len(xy_m)):
        for circle in range(len(centres_m)):
            dx = xy_m[point, 0] - centres_m[circle, 0]
            dy = xy_m[point, 1] - centres_m[circle, 1]
            distance_m = math.sqrt(dx * dx + dy * dy) - radii_m[circle]
            if distance_m < off_m[point]:
                off_m[point], nearest[point] = distance_m, circle
    return off_m, nearest
