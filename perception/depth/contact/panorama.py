"""A class map remapped to azimuth by depression, so that vertical edges become columns."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView
from uav_bt.types.projection import camera_axes, pixel_rays, project

OUTSIDE = 255  # in the panorama: not in the image
_ROWS_PER_PX = 2.0  # finer than the image, so that the borders between its pixels are found
_NO_FRACTIONS = np.empty(0, dtype=np.uint16)  # cells lie on whole pixels
_MIN_DEPRESSION_RAD = 0.02  # below this depression the ground is beyond every lab


@dataclass(frozen=True, kw_only=True)
class Panorama:
    """The remapped class map; row 0 looks down most steeply."""

    ids: NDArray[np.uint8]  # (R, A) class ids; OUTSIDE for cells outside the image
    azimuth_rad: NDArray[np.float64]  # (A,) of each column, increasing, clockwise from the heading
    depression_rad: NDArray[np.float64]  # (R,) of each row, decreasing
    pixel_rad: float  # depression of one pixel at the image's centre

    @classmethod
    def of(cls, ids: NDArray[np.uint8], view: CameraView) -> Panorama:
        """Remap a class map below the horizon.

        Args:
            ids: (H, W) class ids.
            view: the camera, at the map's size.
        """
        layout = _layout(replace(view, height_m=0.0))  # the layout does not depend on the height
        remapped = cv2.remap(
            ids,
            layout.places,
            _NO_FRACTIONS,
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=OUTSIDE,
        )
        return cls(
            ids=np.asarray(remapped, dtype=np.uint8),
            azimuth_rad=layout.azimuth_rad,
            depression_rad=layout.depression_rad,
            pixel_rad=1.0 / view.camera.fy_px,
        )

    @property
    def rows_per_px(self) -> float:
        """Rows per pixel at the image's centre."""
        return _ROWS_PER_PX

    def columns(self, azimuth_rad: NDArray[np.floating]) -> NDArray[np.intp]:
        """Return the column nearest to each azimuth."""
        step = self.azimuth_rad[1] - self.azimuth_rad[0]
        nearest = np.rint((azimuth_rad - self.azimuth_rad[0]) / step)
        return np.asarray(np.clip(nearest, 0, self.azimuth_rad.size - 1).astype(np.intp))

    def rows(self, depression_rad: NDArray[np.floating]) -> NDArray[np.intp]:
        """Return the row nearest to each depression."""
        step = self.depression_rad[0] - self.depression_rad[1]
        nearest = np.rint((self.depression_rad[0] - depression_rad) / step)
        return np.asarray(np.clip(nearest, 0, self.depression_rad.size - 1).astype(np.intp))


@dataclass(frozen=True, kw_only=True)
class _Layout:
    """Image position of each cell of a panorama; depends on camera and attitude only."""

    azimuth_rad: NDArray[np.float64]
    depression_rad: NDArray[np.float64]
    places: Any  # (R, A, 2) int16, column and row


@functools.lru_cache(maxsize=8)  # the gimbal's pitch seldom changes
def _layout(view: CameraView) -> _Layout:
    camera = view.camera
    pixel_rad = 1.0 / camera.fy_px
    left, right, steepest = _extent(view)
    azimuths = np.arange(left, right, 1.0 / camera.fx_px)
    flattest = min(_MIN_DEPRESSION_RAD, steepest - 2.0 * pixel_rad)
    depressions = np.arange(steepest, flattest, -pixel_rad / _ROWS_PER_PX)
    column, row = _places(view, azimuths, depressions)
    places = np.stack([np.rint(column), np.rint(row)], axis=-1)
    whole = np.clip(places, -9, np.iinfo(np.int16).max).astype(np.int16)
    return _Layout(azimuth_rad=azimuths, depression_rad=depressions, places=whole)


def _places(
    view: CameraView, azimuths: NDArray[np.float64], depressions: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the image's column and row of every cell; column -9 for cells behind the camera."""
    axes = camera_axes(view.pitch_rad, view.roll_rad).astype(np.float32)
    level = np.stack([np.cos(azimuths), np.sin(azimuths)]).astype(np.float32)
    flat = np.cos(depressions).astype(np.float32)[:, None]
    down = np.sin(depressions).astype(np.float32)[:, None]
    # Each camera component of a direction is the sum of a level part by azimuth and a vertical one.
    x, y, z = (flat * (axes[:2, k] @ level) + axes[2, k] * down for k in range(3))
    ahead = z > 1e-3
    scale = np.divide(np.float32(1.0), z, out=np.full_like(z, np.float32(1e6)), where=ahead)
    column = x * scale * np.float32(view.camera.fx_px) + np.float32(view.camera.cx_px)
    row = y * scale * np.float32(view.camera.fy_px) + np.float32(view.camera.cy_px)
    column[~ahead] = np.float32(-9.0)
    return column, row


def _extent(view: CameraView) -> tuple[float, float, float]:
    """Return the image's leftmost and rightmost azimuth and its steepest depression."""
    camera = view.camera
    width, height = camera.width_px - 0.5, camera.height_px - 0.5
    across, along = np.linspace(-0.5, width, 17), np.linspace(-0.5, height, 9)
    border = np.concatenate(
        [np.stack([across, np.full_like(across, edge)], axis=-1) for edge in (-0.5, height)]
        + [np.stack([np.full_like(along, edge), along], axis=-1) for edge in (-0.5, width)]
    )
    rays = pixel_rays(border, camera, view.pitch_rad, view.roll_rad)
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    depression = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
    with np.errstate(invalid="ignore"):
        nadir = project(np.array([0.0, 0.0, 1.0]), camera, view.pitch_rad, view.roll_rad)
        below = bool(np.all((nadir >= -0.5) & (nadir <= (width, height))))
    if below:
        return -math.pi, math.pi, math.pi / 2 - 1e-3
    return float(azimuth.min()), float(azimuth.max()), float(depression.max())
