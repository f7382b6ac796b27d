"""Fastest paths over a grid from one cell to all others (Dijkstra's algorithm)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Floats

Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class FastestPaths:
    """The fastest paths from a cell to all others."""

    start: Cell
    time_s: Floats  # (rows, columns) time to each cell; inf where no path leads
    before: NDArray[np.int64]  # (rows, columns) flat index of the cell before each; -1: none

    @cached_property
    def reached(self) -> NDArray[np.intp]:
        """(N,) flat indices of the cells that paths lead to."""
        return np.flatnonzero(np.isfinite(self.time_s))

    @cached_property
    def parents(self) -> NDArray[np.intp]:
        """(N,) index in `reached` of the cell before each; the start precedes itself."""
        number = np.full(self.time_s.size, -1)
        number[self.reached] = np.arange(len(self.reached))
        before = self.before.reshape(-1)[self.reached]
        return np.where(before >= 0, number[np.maximum(before, 0)], np.arange(len(before)))

    def summed(self, values: Floats) -> Floats:
        """Return for each cell the sum of (N,) values over the path to it; 0 without a path.

        The start's value counts once.
        """
        total, parents = values.copy(), self.parents
        start = parents == np.arange(len(parents))
        total[start] = 0.0
        # Each round doubles the length of path that is summed (pointer jumping).
        while not start[parents].all():
            total, parents = total + total[parents], parents[parents]
        found = np.zeros(self.time_s.shape)
        found.reshape(-1)[self.reached] = total + values[start].sum()
        return found

    def after(self, steps: int) -> NDArray[np.intp]:
        """Return the cell on the path to each reached cell after a number of steps.

        Args:
            steps: Number of steps from the start; for a shorter path its end is returned.

        Returns:
            (N, 2) rows and columns.
        """
        own = np.arange(len(self.parents))
        depth = self.summed((self.parents != own).astype(np.float64)).reshape(-1)[self.reached]
        ancestor = np.where(depth <= steps, own, self.parents)
        while (depth[ancestor] > steps).any():
            ancestor = ancestor[ancestor]
        return np.stack(np.divmod(self.reached[ancestor], self.time_s.shape[1]), axis=1)

    def to(self, end: Cell) -> list[Cell]:
        """Return the path from the start to a reached cell, both included."""
        path, width = [end], self.before.shape[1]
        while path[-1] != self.start:
            row, column = divmod(int(self.before[path[-1]]), width)
            path.append((row, column))
        return path[::-1]


def fastest_paths(open_: NDArray[np.bool_], cell_s: Floats, start: Cell) -> FastestPaths:
    """Return the fastest paths from a cell.

    Args:
        open_: (rows, columns) cells that paths may lead over, the start among them.
        cell_s: (rows, columns) time to fly one side length of each cell, seconds.
        start: The cell at which the paths begin.
    """
    from scipy.sparse import coo_array  # noqa: PLC0415  (`uav-bt check` must answer at once)
    from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415  (as above)

    shape = open_.shape
    number = np.full(shape, -1)
    number[open_] = np.arange(np.count_nonzero(open_))
    begins, ends, prices = [], [], []
    height, width = shape
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        there = (slice(down, height), slice(max(0, right), width - max(0, -right)))
        both = (number[here] >= 0) & (number[there] >= 0)
        begins.append(number[here][both])
        ends.append(number[there][both])
        mean = (cell_s[here][both] + cell_s[there][both]) / 2
        prices.append(math.hypot(down, right) * mean)
    count = int(number.max()) + 1
    graph = coo_array(
        (np.concatenate(prices), (np.concatenate(begins), np.concatenate(ends))),
        shape=(count, count),
    ).tocsr()
    times, before = dijkstra(
        graph, directed=False, indices=int(number[start]), return_predecessors=True
    )
    flat = np.flatnonzero(open_)
    time_s = np.full(shape, math.inf)
    time_s[open_] = times
    came_from = np.full(shape, -1, dtype=np.int64)
    came_from[open_] = np.where(before >= 0, flat[np.maximum(before, 0)], -1)
    return FastestPaths(start, time_s, came_from)
