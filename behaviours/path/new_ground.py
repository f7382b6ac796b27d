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
    reach = int(radius_cells)
    framed = np.pad(worth, reach + 1)
    flat, width = framed.reshape(-1), framed.shape[1]
    rows, columns = np.divmod(paths.reached, worth.shape[1])
    places = (rows + reach + 1) * width + columns + reach + 1
    came_rows, came_columns = np.divmod(paths.reached[paths.parents], worth.shape[1])
    down, right = rows - came_rows, columns - came_columns
    added = np.zeros(len(places))
    for step in _STEPS:
        mine = np.flatnonzero((down == step[0]) & (right == step[1]))
        offsets = _crescent(step, radius_cells) @ (width, 1)
        added[mine] = flat[places[mine, None] + offsets].sum(axis=1)
    return paths.summed(added)


@cache
def _crescent(step: tuple[int, int], radius_cells: float) -> NDArray[np.intp]:
    """Return the cells around a place that are not around the place one step before, (K, 2).

    For the step (0, 0) all cells around the place.
    """
    reach = int(radius_cells)
    down, right = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    near = np.hypot(down, right) <= radius_cells
    if step != (0, 0):
        near &= np.hypot(down + step[0], right + step[1]) > radius_cells
    return np.stack([down[near], right[near]], axis=1)
