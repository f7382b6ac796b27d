"""New ground covered by every fastest path, for all ends at once.

The paths from one place form a tree. A path covers the ground of the path to its last cell but one,
and the crescent that the last step adds. One number per cell, summed from the root along the tree,
gives the ground of all paths. Ground counts twice where a path comes back near to itself, which is
rare for fastest paths, and in a small part where a path turns.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviours.path.fastest import FastestPaths
from uav_bt.types.arrays import Floats

_STEPS: Final = tuple(product((-1, 0, 1), repeat=2))  # (0, 0): at the start


def passed_for_the_first_time(paths: FastestPaths, worth: Floats, radius_cells: float) -> Floats:
    """Return the worth of the ground that the path to each cell covers, in cells.

    Args:
        paths: The paths from the drone.
        worth: (rows, columns) worth of covering each cell.
        radius_cells: Ground within this distance of a path counts as covered.

    Returns:
        (rows, columns) worth; 0 where no path leads.
    """
    from behaviours.path.compiled_loops import sum_of_crescents  # noqa: PLC0415  (see that module)

    cells, begins = _crescents(radius_cells)
    return sum_of_crescents(paths.order, paths.before.reshape(-1), worth, cells, begins)


@cache
def _crescents(radius_cells: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells that each step of `_STEPS` adds: around its end, but not its beginning.

    For the step (0, 0) all cells around the place.

    Returns:
        (K, 2) rows and columns relative to the step's end, grouped by step; (10,) index of the
        first cell of each step.
    """
    reach = int(radius_cells)
    around = np.argwhere(np.ones((2 * reach + 1, 2 * reach + 1))) - reach
    around = around[np.hypot(*around.T) <= radius_cells]
    added = [
        around[np.hypot(*(around + step).T) > radius_cells] if step != (0, 0) else around
        for step in _STEPS
    ]
    return np.vstack(added), np.cumsum([0, *map(len, added)])
