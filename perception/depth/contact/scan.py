"""A class map remapped to azimuth by depression, so that vertical edges become columns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView
from uav_bt.compiled import compiled
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Floats32, Ids, Indices
from uav_bt.types.projection import camera_axes, pixel_rays, project

NOT_IN_IMAGE: Final = 255  # in the panorama: not in the image
_ROWS_PER_PX: Final = 2  # finer than the image, so that the borders between its pixels are found
_MIN_DEPRESSION_RAD: Final = 0.02  # below this depression the ground is beyond every lab
_RUN: Final = 2 * _ROWS_PER_PX  # rows of the side above a base; fewer are mask noise
# Largest number of rows from one class to the next; networks blur borders into other classes.
_REACH: Final = 1 + 2 * _ROWS_PER_PX

Runs = tuple[NDArray[np.int32], NDArray[np.int32]]
"""(C, A) row where the lowest run of each class begins in each column, -1 without a run of `_RUN`
rows; (C, A) uppermost row of the class, be it part of a run or not, -1 where it is not visible."""


@dataclass(frozen=True, kw_only=True)
class Panorama:
    """The remapped class map; row 0 looks down most steeply."""

    ids: Ids  # (R, A) class ids; NOT_IN_IMAGE for cells outside the image
    azimuth_rad: Floats  # (A,) of each column, increasing, clockwise from the heading
    depression_rad: Floats  # (R,) of each row, decreasing
    pixel_rad: float  # depression of one pixel at the image's centre

    @classmethod
    def of(cls, ids: Ids, view: CameraView) -> Panorama:
        """Remap a class map, (H, W), below the horizon; the view is at the map's size."""
        camera, pixel_rad = view.camera, 1.0 / view.camera.fy_px
        left, right, steepest = _extent(camera, view.pitch_rad, view.roll_rad)
        azimuths = np.arange(left, right, 1.0 / camera.fx_px)
        flattest = min(_MIN_DEPRESSION_RAD, steepest - 2.0 * pixel_rad)
        depressions = np.arange(steepest, flattest, -pixel_rad / _ROWS_PER_PX)
        axes = camera_axes(view.pitch_rad, view.roll_rad).astype(np.float32)
        level = np.stack([np.cos(azimuths), np.sin(azimuths)]).astype(np.float32)
        remapped = _remapped(
            np.ascontiguousarray(ids),
            np.ascontiguousarray(axes[:2].T @ level),
            np.stack([np.cos(depressions), np.sin(depressions)], axis=-1).astype(np.float32),
            np.ascontiguousarray(axes[2]),
            np.array(camera.pinhole_px, dtype=np.float32),
        )
        return cls(
            ids=remapped, azimuth_rad=azimuths, depression_rad=depressions, pixel_rad=pixel_rad
        )

    def runs(self, count: int) -> Runs:
        """Return the runs of classes 0 to `count` - 1."""
        return _runs(self.ids, count, _RUN)

    def next_row(self, rows: Indices, columns: Indices, wanted: int, step: int) -> Indices:
        """Return the row of a class right above (step 1) or below (-1) cells; -1 without one."""
        return _following(self.ids, rows, columns, wanted, step, _REACH)

    def columns(self, azimuth_rad: Floats) -> Indices:
        """Return the column nearest to each azimuth."""
        return _nearest(azimuth_rad, self.azimuth_rad)

    def rows(self, depression_rad: Floats) -> Indices:
        """Return the row nearest to each depression."""
        return _nearest(-depression_rad, -self.depression_rad)


def _nearest(values: Floats, grid: Floats) -> Indices:
    nearest = np.rint((values - grid[0]) / (grid[1] - grid[0]))
    return np.asarray(np.clip(nearest, 0, grid.size - 1).astype(np.intp))


@lru_cache(maxsize=8)  # the gimbal's pitch seldom changes
def _extent(camera: CameraModel, pitch_rad: float, roll_rad: float) -> tuple[float, float, float]:
    """Return the image's leftmost and rightmost azimuth and its steepest depression."""
    width, height = camera.width_px - 0.5, camera.height_px - 0.5
    across, along = np.linspace(-0.5, width, 17), np.linspace(-0.5, height, 9)
    border = np.concatenate(
        [np.stack([across, np.full_like(across, edge)], axis=-1) for edge in (-0.5, height)]
        + [np.stack([np.full_like(along, edge), along], axis=-1) for edge in (-0.5, width)]
    )
    rays = pixel_rays(border, camera, pitch_rad, roll_rad)
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    depression = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
    with np.errstate(invalid="ignore"):
        nadir = project(np.array([0.0, 0.0, 1.0]), camera, pitch_rad, roll_rad)
        below = bool(np.all((nadir >= -0.5) & (nadir <= (width, height))))
    if below:
        return -math.pi, math.pi, math.pi / 2 - 1e-3
    return float(azimuth.min()), float(azimuth.max()), float(depression.max())


@compiled(
    "uint8[:, ::1](Array(uint8, 2, 'C', readonly=True), float32[:, ::1], float32[:, ::1],"
    " float32[::1], float32[::1])"
)
def _remapped(
    ids: Ids, across: Floats32, directions: Floats32, vertical: Floats32, pinhole_px: Floats32
) -> Ids:
    """Look up the nearest pixel of each cell of a panorama; (R, A), NOT_IN_IMAGE beyond the image.

    Each camera component of a direction is the sum of a level part by azimuth and a vertical one.

    Args:
        ids: (H, W) class ids.
        across: (3, A) camera components of the level direction at each azimuth.
        directions: (R, 2) cosine and sine of each depression.
        vertical: (3,) camera components of the downward direction.
        pinhole_px: (4,) focal lengths and principal point: fx, fy, cx, cy.
    """
    fx, fy, cx, cy = pinhole_px[0], pinhole_px[1], pinhole_px[2], pinhole_px[3]
    first = np.float32(0.0)
    end_u, end_v = np.float32(ids.shape[1]), np.float32(ids.shape[0])
    width, pixels = np.int32(ids.shape[1]), ids.ravel()
    places = np.empty(across.shape[1], dtype=np.int32)
    remapped = np.empty((len(directions), across.shape[1]), dtype=np.uint8)
    for row in range(remapped.shape[0]):
        level, down = directions[row, 0], directions[row, 1]
        # Without branches, so that the processor computes several columns at once.
        for column in range(remapped.shape[1]):
            z = level * across[2, column] + vertical[2] * down
            scale = np.float32(1.0) / z
            u = np.rint((level * across[0, column] + vertical[0] * down) * scale * fx + cx)
            v = np.rint((level * across[1, column] + vertical[1] * down) * scale * fy + cy)
            inside = (u >= first) & (u < end_u) & (v >= first) & (v < end_v)
            ahead = z > np.float32(1e-3)
            places[column] = np.int32(v) * width + np.int32(u) if inside & ahead else np.int32(-1)
        for column in range(remapped.shape[1]):
            place = places[column]
            remapped[row, column] = pixels[place] if place >= 0 else NOT_IN_IMAGE
    return remapped


@compiled("UniTuple(int32[:, ::1], 2)(uint8[:, ::1], int64, int64)")
def _runs(ids: Ids, count: int, run: int) -> Runs:
    """Find the lowest run of `run` rows, and the uppermost row, of each class in each column."""
    rows, columns = ids.shape
    first = np.full((count, columns), -1, dtype=np.int32)
    last = np.full((count, columns), -1, dtype=np.int32)
    before = np.full(columns, NOT_IN_IMAGE, dtype=np.uint8)  # class in the row before
    begin = np.zeros(columns, dtype=np.int32)  # row where the present run begins
    for row in range(rows):
        for column in range(columns):
            thing = ids[row, column]
            if thing != before[column]:
                before[column], begin[column] = thing, row
            if thing >= count:  # outside the image
                continue
            last[thing, column] = row
            if row - begin[column] + 1 == run and first[thing, column] < 0:
                first[thing, column] = begin[column]
    return first, last


@compiled("intp[::1](uint8[:, ::1], intp[::1], intp[::1], int64, int64, int64)")
def _following(  # noqa: PLR0917 - Numba passes arguments by position
    ids: Ids, rows: Indices, columns: Indices, wanted: int, step: int, reach: int
) -> Indices:
    """Return the first row of a class within `reach` rows above or below cells; -1 without one."""
    found = np.full(len(rows), -1, dtype=np.intp)
    for cell in range(len(rows)):
        row = rows[cell]
        for _ in range(reach):
            row += step
            if not 0 <= row < ids.shape[0]:
                break
            if ids[row, columns[cell]] == wanted:
                found[cell] = row
                break
    return found
