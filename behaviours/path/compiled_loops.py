"""Loops of the planner that are compiled to machine code.

They stand apart because Numba takes 0.2 s to import, and `uav-bt check` must answer at once. Leaves
that plan import this module when they are set up, so that nothing is compiled in flight. Grids have
the shape (R, C); cells are flat indices; `before` is the cell before each on its path, -1: none.
"""

from __future__ import annotations

import heapq
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.compiled import compiled
from uav_bt.types.arrays import Flags, Floats

_DIAGONAL: Final = math.sqrt(2.0)  # length of a step to a diagonal neighbour, cells


@compiled(
    "Tuple((float64[:, ::1], int64[:, ::1], int64[::1]))(boolean[:, ::1], float64[:, ::1], int64)"
)
def search(
    open_: Flags, cell_s: Floats, start: int
) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return time, `before` and the reached cells by increasing time (Dijkstra's algorithm)."""
    height, width = open_.shape
    time_s, before = np.full(height * width, math.inf), np.full(height * width, -1)
    order = np.empty(height * width, dtype=np.int64)
    settled = np.zeros(height * width, dtype=np.bool_)
    time_s[start] = 0.0
    queue, count = [(0.0, start)], 0
    while queue:
        here_s, here = heapq.heappop(queue)
        if settled[here]:
            continue
        settled[here] = True
        order[count] = here
        count += 1
        row, column = here // width, here % width
        for next_row in range(max(row - 1, 0), min(row + 2, height)):
            for next_column in range(max(column - 1, 0), min(column + 2, width)):
                there = next_row * width + next_column
                if settled[there] or not open_[next_row, next_column]:
                    continue
                length = 1.0 if next_row == row or next_column == column else _DIAGONAL
                mean_s = (cell_s[row, column] + cell_s[next_row, next_column]) / 2
                there_s = here_s + length * mean_s
                if there_s < time_s[there]:
                    time_s[there] = there_s
                    before[there] = here
                    heapq.heappush(queue, (there_s, there))
    return time_s.reshape(open_.shape), before.reshape(open_.shape), order[:count].copy()


@compiled("int64[::1](int64[::1], int64[::1], int64)")
def ancestors(order: NDArray[np.int64], before: NDArray[np.int64], steps: int) -> NDArray[np.int64]:
    """Return the cell after some steps of the path to each cell, its end if it is shorter, or -1.

    `order` is that of `search`.
    """
    found = np.full(before.size, -1)
    depth = np.zeros(before.size, dtype=np.int64)
    for cell in order:
        came_from = before[cell]
        if came_from >= 0:
            depth[cell] = depth[came_from] + 1
        found[cell] = cell if depth[cell] <= steps else found[came_from]
    return found


@compiled("float64[:, ::1](int64[::1], int64[::1], float64[:, ::1], int64[:, ::1], int64[::1])")
def sum_of_crescents(
    order: NDArray[np.int64],
    before: NDArray[np.int64],
    worth: Floats,
    cells: NDArray[np.int64],
    begins: NDArray[np.int64],
) -> Floats:
    """Return, for each cell, the worth of the cells that the steps of its path add; else 0.

    `cells` are rows and columns, (K, 2), that a step adds, from its end, grouped by step. The group
    of the step (d, r), number 3 * (d + 1) + r + 1, begins at `begins`, (10,); (0, 0): the start.
    """
    height, width = worth.shape
    total = np.zeros(worth.shape)
    for cell in order:
        row, column = cell // width, cell % width
        came_from, step, added = before[cell], 4, 0.0
        if came_from >= 0:
            came_row, came_column = came_from // width, came_from % width
            step = 3 * (row - came_row + 1) + column - came_column + 1
            added = total[came_row, came_column]
        for number in range(begins[step], begins[step + 1]):
            y, x = row + cells[number, 0], column + cells[number, 1]
            if 0 <= y < height and 0 <= x < width:
                added += worth[y, x]
        total[row, column] = added
    return total


@compiled("boolean[::1](float64[:, ::1], float64[:, ::1], float64, int64)")
def has_near(points_m: Floats, others_m: Floats, near_m: float, least: int) -> Flags:
    """Return which points, (N, 2), have at least a number of others, (M, 2), within a distance."""
    found = np.zeros(len(points_m), dtype=np.bool_)
    for point in range(len(points_m)):
        count = 0
        for other in range(len(others_m)):
            x_m = points_m[point, 0] - others_m[other, 0]
            y_m = points_m[point, 1] - others_m[other, 1]
            if math.sqrt(x_m * x_m + y_m * y_m) < near_m:
                count += 1
                if count >= least:
                    found[point] = True
                    break
    return found
