"""Fastest paths over a grid from one cell to all others (Dijkstra's algorithm)."""

from __future__ import annotations

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
    order: NDArray[np.int64]  # (N,) flat indices of the reached cells, by increasing time

    @cached_property
    def reached(self) -> NDArray[np.intp]:
        """(N,) flat indices of the cells that paths lead to, by increasing index."""
        return np.sort(self.order)

    def after(self, steps: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the cell on the path to each reached cell after a number of steps.

        Args:
            steps: Number of steps from the start; for a shorter path its end is returned.

        Returns:
            Rows and columns, (N,) each.
        """
        from behaviours.path.compiled_loops import ancestors  # noqa: PLC0415  (see that module)

        found = ancestors(self.order, self.before.reshape(-1), steps)
        return np.divmod(found[self.reached], self.before.shape[1])

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
    from behaviours.path.compiled_loops import search  # noqa: PLC0415  (see that module)

    first = start[0] * open_.shape[1] + start[1]
    found = search(np.ascontiguousarray(open_), np.ascontiguousarray(cell_s), first)
    return FastestPaths(start, *found)
