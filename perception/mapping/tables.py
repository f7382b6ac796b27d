"""Points of the map as tables: columns of one length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

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
        return type(self)(**{name: column[which] for name, column in vars(self).items()})

    def with_rows(self, other: Self) -> Self:
        """Return this table with another's rows below."""
        mine, theirs = vars(self), vars(other)
        return type(self)(**{name: np.concatenate([mine[name], theirs[name]]) for name in mine})


def first_in_cells(xy_m: Floats, cell_m: float) -> Indices:
    """Return the row of the first point in each cell of a grid, ordered by cell.

    Args:
        xy_m: (N, 2) points.
        cell_m: side of a cell.

    Returns:
        (C,) row numbers.
    """
    cells = np.floor(xy_m / cell_m).astype(np.int64)
    _, first = np.unique((cells[:, 0] << 32) + cells[:, 1], return_index=True)
    return np.asarray(first)
