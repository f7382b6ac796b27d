"""Texture of the ground from views straight down, and its displacement between two pictures.

The local mean is removed, so that light and exposure do not matter. The displacement comes from
masked normalised cross-correlation (Padfield, Masked object registration in the Fourier domain,
2012). Numbers without a reason are chosen.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from uav_bt.landing_marks import MarkView
from uav_bt.types import MIN_VIEW_HEIGHT_M, Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.projection import project

Picture = NDArray[np.float32]

STRAIGHT_RAD: Final = math.radians(-75.0)  # pitch up to which a view is straight down
_CELL_M: Final = 0.016  # of a picture; a pixel of 320 columns covers 7 mm at 1.5 m
_SIDE_PX: Final = 192  # of a picture, 3.1 m: a view straight down is 2.1 m wide at 1.5 m
_SMOOTH_M: Final = 0.012  # standard deviation of the filter against pixel noise
_LOCAL_M: Final = 0.12  # of the local mean that is removed
_BORDER_PX: Final = 2.0  # pixels at the image's border that do not count
_FLAT: Final = 1.0  # variance, grey levels squared, below which there is no texture
_APART_M: Final = 0.06  # a maximum is the largest within this distance along each axis


class GroundTexture(NamedTuple):
    """Texture of a square around the origin of a level frame: rows along x, columns along y."""

    texture: Picture  # (S, S), 0 where unknown
    known: Flags  # (S, S) cells that were seen


class Displacement(NamedTuple):
    """A displacement at which two pictures agree."""

    x_m: float
    y_m: float
    score: float  # correlation of the texture, -1 to 1

    @property
    def range_m(self) -> float:
        """Length of the displacement."""
        return math.hypot(self.x_m, self.y_m)


def ground_texture(view: MarkView, frame: Pose2D) -> GroundTexture | None:
    """Return the ground of a view straight down; None for another view, or far from the frame.

    `frame` is the picture's frame relative to the body. Every pixel counts as ground: networks that
    were trained on oblique views see no ground in such a view.
    """
    height_m, pitch_rad = view.frame.height_above_ground_m, view.frame.gimbal_pitch_rad
    if not (height_m > MIN_VIEW_HEIGHT_M and pitch_rad <= STRAIGHT_RAD):
        return None
    image_px = view.frame.image.shape[:2]
    camera = view.camera.resized(image_px[1], image_px[0])
    along_m = (np.arange(_SIDE_PX) - (_SIDE_PX - 1) / 2.0) * _CELL_M
    middles_m = np.stack(np.meshgrid(along_m, along_m, indexing="ij"), axis=-1).reshape(-1, 2)
    places_m = frame.points_to_world(middles_m)
    places_m[:, 0] -= camera.forward_offset_m
    level_m = np.column_stack([places_m, np.full(len(places_m), height_m)])
    pixels = project(level_m, camera, pitch_rad).reshape(_SIDE_PX, _SIDE_PX, 2)
    limits_px = np.array(image_px[::-1]) - 1.0 - _BORDER_PX
    with np.errstate(invalid="ignore"):
        inside = (pixels >= _BORDER_PX) & (pixels <= limits_px)
    known: Flags = np.asarray(inside.all(axis=-1))
    if not known.any():
        return None
    columns, rows = (np.where(known, pixels[..., each], -1.0).astype(np.float32) for each in (0, 1))
    grey = cv2.cvtColor(view.frame.image, cv2.COLOR_RGB2GRAY)
    flat = cv2.remap(grey, columns, rows, cv2.INTER_LINEAR).astype(np.float32)
    weight = known.astype(np.float32)
    fine, coarse = (_mean(flat * weight, weight, std_m) for std_m in (_SMOOTH_M, _LOCAL_M))
    return GroundTexture(np.asarray((fine - coarse) * weight, dtype=np.float32), known)


def _mean(weighted: Picture, weight: Picture, std_m: float) -> Picture:
    """Return the local mean of known cells."""
    total, share = (cv2.GaussianBlur(each, (0, 0), std_m / _CELL_M) for each in (weighted, weight))
    return np.asarray(total / np.maximum(share, 1e-6), dtype=np.float32)


def mean_texture(pictures: list[GroundTexture]) -> GroundTexture:
    """Return the mean texture of the cells that at least one picture shows."""
    total, count = sum(each.texture for each in pictures), sum(each.known for each in pictures)
    return GroundTexture((total / np.maximum(count, 1)).astype(np.float32), np.asarray(count) > 0)


class KnownGround:
    """A picture of the ground, prepared for displacements of up to `reach_m` along each axis."""

    def __init__(self, picture: GroundTexture, reach_m: float) -> None:
        self._reach_px = round(reach_m / _CELL_M)
        self._size_px = fft.next_fast_len(_SIDE_PX + self._reach_px, real=True)
        self._parts = self._transformed(picture)

    def _transformed(self, picture: GroundTexture) -> list[NDArray[np.complex64]]:
        parts = picture.known.astype(np.float32), picture.texture, picture.texture**2
        return [fft.rfft2(part, (self._size_px, self._size_px)) for part in parts]

    def displacements(
        self, picture: GroundTexture, *, min_shared_m2: float, least: float
    ) -> list[Displacement]:
        """Return the displacements of a picture at local maxima of the correlation, best first."""
        correlation = self._correlation(picture, min_shared_m2)
        width_px = 2 * round(_APART_M / _CELL_M) + 1
        widest = cv2.dilate(correlation, np.ones((width_px, width_px), dtype=np.uint8))
        rows, columns = np.nonzero((correlation >= widest) & (correlation >= least))
        found = []
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            x_px = row + _vertex(correlation[:, column], row) - self._reach_px
            y_px = column + _vertex(correlation[row], column) - self._reach_px
            score = float(correlation[row, column])
            found.append(Displacement(x_px * _CELL_M, y_px * _CELL_M, score))
        return sorted(found, key=lambda each: -each.score)

    def _correlation(self, picture: GroundTexture, min_shared_m2: float) -> Floats:
        """Return the correlation at displacements of -R to R cells along x and y, (2 R + 1,) * 2.

        It is -1 where too little ground or no texture is common.
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
            (count * _CELL_M**2 >= min_shared_m2) & (spread_here > _FLAT) & (spread_there > _FLAT)
        )
        scale = np.sqrt(np.where(usable, spread_here * spread_there, 1.0))
        return np.where(usable, common / scale, -1.0)


def _vertex(line: Floats, place: int) -> float:
    """Return the vertex of the parabola through a maximum and its neighbours, in cells from it."""
    if not 0 < place < len(line) - 1:
        return 0.0
    before, top, after = (float(value) for value in line[place - 1 : place + 2])
    bend = before - 2.0 * top + after
    if bend >= 0.0 or min(before, after) <= -1.0:
        return 0.0
    return 0.5 * (before - after) / bend
