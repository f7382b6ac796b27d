"""A grid over drone and goal, in metres to the north and east of the drone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Cell = tuple[int, int]
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
        """Return a grid over drone and goal, and so far around both.

        Args:
            goal_m: (2,) metres north and east of the drone.
            margin_m: around both.
            cell_m: size of a cell.
        """
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
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        cells = np.rint((points_m - self.corner_m) / self.cell_m).astype(int)
        inside = ((cells >= 0) & (cells < self.shape)).all(axis=1)
        if not inside.any():
            return np.full(self.shape, np.inf)
        free = np.ones(self.shape, dtype=np.uint8)
        free[tuple(cells[inside].T)] = 0
        return self.cell_m * cv2.distanceTransform(free, cv2.DIST_L2, 5).astype(np.float64)


def costs_to_go(step_costs: Floats, goal: Cell) -> Floats:
    """Return the cost of the cheapest path from each cell to the goal (Dijkstra's algorithm).

    Args:
        step_costs: (rows, columns) of leaving each cell towards a neighbour beside it, positive;
            inf for closed cells.
        goal: where the cost is 0.

    Returns:
        (rows, columns), inf where no path leads to the goal.
    """
    from scipy.sparse import coo_array  # noqa: PLC0415  (`uav-bt check` must answer at once)
    from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415  (as above)

    height, width = step_costs.shape
    cells = np.arange(step_costs.size).reshape(height, width)
    framed = np.pad(cells, 1, constant_values=-1)
    steps = [
        (framed[1 + row : 1 + row + height, 1 + column : 1 + column + width], length * step_costs)
        for row, column, length in _NEIGHBOURS
    ]
    beside, prices = (np.stack(arrays) for arrays in zip(*steps, strict=True))
    open_ = (beside >= 0) & np.isfinite(prices)
    # Dijkstra starts at the goal, so every step is entered the other way round.
    ends = (beside[open_], np.broadcast_to(cells, beside.shape)[open_])
    graph = coo_array((prices[open_], ends), shape=(cells.size, cells.size)).tocsr()
    return np.asarray(dijkstra(graph, indices=cells[goal]).reshape(height, width))


def descent(to_go: Floats, start: Cell) -> NDArray[np.intp]:
    """Return the cells, (K, 2), from the start to the goal, always to the cheapest neighbour.

    The predecessors that SciPy's csgraph returns break ties between equal paths differently, so
    with them flights would differ.

    Args:
        to_go: as `costs_to_go` returns it.
        start: the first cell.
    """
    path = [start]
    while to_go[path[-1]] > 0.0:
        row, column = path[-1]
        around = [
            (row + down, column + right)
            for down, right, _ in _NEIGHBOURS
            if 0 <= row + down < to_go.shape[0] and 0 <= column + right < to_go.shape[1]
        ]
        best = min(around, key=lambda cell: float(to_go[cell]))
        if to_go[best] >= to_go[path[-1]]:
            break
        path.append(best)
    return np.array(path)
