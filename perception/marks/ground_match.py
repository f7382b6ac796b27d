"""Displacement between two pictures of the ground: masked normalised cross-correlation.

The correlation is normalised over the cells that are known in both pictures, for every displacement
at once (Padfield, Masked object registration in the Fourier domain, 2012).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from perception.marks.ground_picture import CELL_M, GroundPicture
from uav_bt.types.arrays import Floats

_FLAT: Final = 1.0  # variance of texture, grey levels squared, below which there is none. Chosen.


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One displacement at which two pictures agree.

    Attributes:
        x_m: Displacement of the second picture along x.
        y_m: Along y.
        score: Correlation of the texture, -1 to 1.
    """

    x_m: float
    y_m: float
    score: float

    @property
    def range_m(self) -> float:
        """Length of the displacement."""
        return math.hypot(self.x_m, self.y_m)


class KnownGround:
    """A picture of the ground, prepared for comparison with others.

    Args:
        picture: The picture.
        reach_m: Largest displacement along each axis.
    """

    def __init__(self, picture: GroundPicture, reach_m: float) -> None:
        side_px = len(picture.texture)
        self._reach_px = round(reach_m / CELL_M)
        self._size_px = fft.next_fast_len(side_px + self._reach_px, real=True)
        self._parts = self._transformed(picture)

    def _transformed(self, picture: GroundPicture) -> list[NDArray[np.complex64]]:
        texture, known = picture.texture, picture.known.astype(np.float32)
        size = (self._size_px, self._size_px)
        return [fft.rfft2(part, size) for part in (known, texture, texture**2)]

    def correlation(self, picture: GroundPicture, min_shared_m2: float) -> Floats:
        """Return the correlation of a picture with this one at each displacement.

        Args:
            picture: The picture, of the same shape.
            min_shared_m2: Least area that must be known in both.

        Returns:
            (2 R + 1, 2 R + 1): rows by displacement of the given picture along x, columns along y,
            from -R to R cells; -1 where too little ground or no texture is common.
        """
        known, here, here2 = self._parts
        seen, there, there2 = self._transformed(picture)
        reach = np.arange(-self._reach_px, self._reach_px + 1)

        def product(first: NDArray[np.complex64], second: NDArray[np.complex64]) -> Floats:
            whole = fft.irfft2(np.conj(first) * second, (self._size_px, self._size_px))
            return np.asarray(whole[np.ix_(reach, reach)], dtype=np.float64)

        count = np.maximum(product(known, seen), 1.0)
        mean_here, mean_there = product(here, seen) / count, product(known, there) / count
        spread_here = product(here2, seen) / count - mean_here**2
        spread_there = product(known, there2) / count - mean_there**2
        common = product(here, there) / count - mean_here * mean_there
        usable = (
            (count * CELL_M**2 >= min_shared_m2) & (spread_here > _FLAT) & (spread_there > _FLAT)
        )
        scale = np.sqrt(np.where(usable, spread_here * spread_there, 1.0))
        return np.where(usable, common / scale, -1.0)


def candidates(correlation: Floats, *, least: float, apart_m: float = 0.06) -> list[Candidate]:
    """Return the local maxima of a correlation, best first.

    Args:
        correlation: From `KnownGround.correlation`.
        least: Least score.
        apart_m: A maximum is the largest within this distance along each axis.
    """
    reach_px = len(correlation) // 2
    width_px = 2 * round(apart_m / CELL_M) + 1
    widest = cv2.dilate(correlation, np.ones((width_px, width_px), dtype=np.uint8))
    rows, columns = np.nonzero((correlation >= widest) & (correlation >= least))
    found = []
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        across = _vertex(correlation[:, column], row)
        along = _vertex(correlation[row], column)
        found.append(
            Candidate(
                x_m=(row + across - reach_px) * CELL_M,
                y_m=(column + along - reach_px) * CELL_M,
                score=float(correlation[row, column]),
            )
        )
    return sorted(found, key=lambda each: -each.score)


def _vertex(line: Floats, place: int) -> float:
    """Return the vertex of the parabola through a maximum and its neighbours, in cells from it."""
    if not 0 < place < len(line) - 1:
        return 0.0
    before, top, after = (float(value) for value in line[place - 1 : place + 2])
    bend = before - 2.0 * top + after
    if bend >= 0.0 or min(before, after) <= -1.0:
        return 0.0
    return 0.5 * (before - after) / bend
