"""Fastest paths over a grid from one cell to all others, and the ground along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Flags, Floats

Cell = tuple[int, int]

_STEPS: Final = tuple(product((-1, 0, 1), repeat=2))  # (0, 0): at the start


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
        """Return rows and columns, (N,) each, that the paths to `reached` have after some steps."""
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

    def covered(self, worth: Floats, radius_cells: float) -> Floats:
        """Return the worth of the cells within a radius of the path to each cell, (rows, columns).

        The paths form a tree. A path covers what the path to its last cell but one covers, and the
        crescent that the last step adds. Ground counts twice where a path comes back near to
        itself, which is rare for fastest paths, and in a small part where a path turns.
        """
        from behaviours.path.compiled_loops import sum_of_crescents  # noqa: PLC0415

        cells, begins = _crescents(radius_cells)
        return sum_of_crescents(self.order, self.before.reshape(-1), worth, cells, begins)


def fastest_paths(open_: Flags, cell_s: Floats, start: Cell) -> FastestPaths:
    """Return the fastest paths over open cells, the start among them (Dijkstra's algorithm).

    `cell_s` is the time to fly one side length of each cell.
    """
    from behaviours.path.compiled_loops import search  # noqa: PLC0415  (see that module)

    first = start[0] * open_.shape[1] + start[1]
    found = search(np.ascontiguousarray(open_), np.ascontiguousarray(cell_s), first)
    return FastestPaths(start, *found)


@cache
def _crescents(radius_cells: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells that each step of `_STEPS` adds: around its end, but not its beginning.

    (K, 2) rows and columns from the step's end, grouped by step; (10,) where each group begins. The
    step (0, 0) adds all cells around the place.
    """
    reach = int(radius_cells)
    around = np.argwhere(np.ones((2 * reach + 1, 2 * reach + 1))) - reach
    around = around[np.hypot(*around.T) <= radius_cells]
    added = [
        around[np.hypot(*(around + step).T) > radius_cells] if step != (0, 0) else around
        for step in _STEPS
    ]
    return np.vstack(added), np.cumsum([0, *map(len, added)])
