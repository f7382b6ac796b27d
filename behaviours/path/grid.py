"""A grid over drone and goal, in metres to the north and east of the drone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cell", "Floats", "Grid", "costs_to_go", "descent"]

Floats = NDArray[np.float64]
Cell = tuple[int, int]
# Rounds until the costs to go are final: as many as the way has cells, which is far less.
_MOST_ROUNDS = 300
_NEIGHBOURS = tuple(
    (row, column, math.hypot(row, column))
    for row in (-1, 0, 1)
    for column in (-1, 0, 1)
    if row or column
)


@dataclass(frozen=True)
class Grid:
    """Cells, north by east; the drone stands at (0, 0) m.

    A grid that turned with the drone would round differently, and so change the plan, every tick.
    """

    corner_m: Floats
    cell_m: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, goal_m: Floats, *, margin_m: float, cell_m: float) -> Grid:
        """Lay a grid over drone and goal and so far around both."""
        corner_m = np.minimum(goal_m, 0.0) - margin_m
        size_m = np.maximum(goal_m, 0.0) + margin_m - corner_m
        rows, columns = np.ceil(size_m / cell_m).astype(int) + 1
        return cls(corner_m, cell_m, (int(rows), int(columns)))

    def cell(self, place_m: Floats) -> Cell:
        """Return the cell of a place, the nearest one for places outside."""
        nearest = np.rint((place_m - self.corner_m) / self.cell_m)
        row, column = np.clip(nearest, 0, np.array(self.shape) - 1).astype(int)
        return int(row), int(column)

    def places_m(self) -> Floats:
        """Return the centres of the cells, (rows, columns, 2)."""
        return np.asarray(self.corner_m + self.cell_m * np.moveaxis(np.indices(self.shape), 0, -1))

    def clearance_m(self, points_m: Floats) -> Floats:
        """Return each cell's distance to the nearest of the points in the grid, inf without any."""
        import cv2  # noqa: PLC0415 - late: `uav-bt check` must answer at once

        cells = np.rint((points_m - self.corner_m) / self.cell_m).astype(int)
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=1)
        if not inside.any():
            return np.full(self.shape, np.inf)
        free = np.ones(self.shape, dtype=np.uint8)
        free[tuple(cells[inside].T)] = 0
        return self.cell_m * cv2.distanceTransform(free, cv2.DIST_L2, 5).astype(np.float64)


def costs_to_go(step_costs: Floats, goal: Cell) -> Floats:
    """Return what the cheapest way from each cell to the goal costs (Bellman's equation).

    Args:
        step_costs: of leaving each cell towards a neighbour beside it; inf for closed cells.
        goal: where the cost is nothing.
    """
    height, width = step_costs.shape
    priced = [(row, column, length * step_costs) for row, column, length in _NEIGHBOURS]
    padded = np.full((height + 2, width + 2), np.inf)
    to_go = padded[1:-1, 1:-1]
    to_go[goal] = 0.0
    for _ in range(_MOST_ROUNDS):
        before = to_go.copy()
        for row, column, price in priced:
            neighbour = padded[1 + row : 1 + row + height, 1 + column : 1 + column + width]
            np.minimum(to_go, neighbour + price, out=to_go)
        if np.array_equal(before, to_go):
            break
    return to_go.copy()


def descent(to_go: Floats, start: Cell) -> NDArray[np.intp]:
    """Return the cells of the way, (K, 2), from the start to the goal."""
    way = [start]
    while to_go[way[-1]] > 0.0:
        row, column = way[-1]
        around = [
            (row + down, column + right)
            for down, right, _ in _NEIGHBOURS
            if 0 <= row + down < to_go.shape[0] and 0 <= column + right < to_go.shape[1]
        ]
        best = min(around, key=lambda cell: float(to_go[cell]))
        if to_go[best] >= to_go[way[-1]]:
            break
        way.append(best)
    return np.array(way)
