"""Rays, ground points and projections for a camera on a stabilised gimbal.

Everything is expressed in the *level frame* of the camera: x forward along the heading, y right,
z down, origin at the camera's optical centre. The gimbal keeps the horizon level, so its pitch is
the only rotation between this frame and OpenCV's camera frame (x right, y down, z along the optical
axis):

    optical axis = (cos p, 0, -sin p),  image right = (0, 1, 0),  image down = (sin p, 0, cos p)

with p the gimbal pitch, negative when it points down. A gimbal sometimes leaves a little roll about
the optical axis, which can be given. The paper's axes (X up, Y lateral, Z forward) map to
(-z, y, x) here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel
from uav_bt.types.pose import clamp

_BESIDE_RAD = math.pi / 2 - 1e-6  # from the optical axis; beyond, rays do not meet the image plane


def camera_axes(gimbal_pitch_rad: float, roll_rad: float = 0.0) -> NDArray[np.float64]:
    """Return the rotation from the camera frame to the level frame, (3, 3).

    `roll_rad` is that of the image about the optical axis, right side down positive.
    """
    c, s = math.cos(gimbal_pitch_rad), math.sin(gimbal_pitch_rad)
    upright = np.array([[0.0, s, c], [1.0, 0.0, 0.0], [0.0, c, -s]])
    if roll_rad == 0.0:
        return upright
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    return np.asarray(upright @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))


def pixel_rays(
    pixels: ArrayLike, camera: CameraModel, gimbal_pitch_rad: float, roll_rad: float = 0.0
) -> NDArray[np.float64]:
    """Return pixels, (..., 2) as (column, row), as rays (..., 3) of unit depth in the level frame.

    The camera is that of the pixels' image size; its distortion is not applied.
    """
    array = np.asarray(pixels, dtype=np.float64)
    x = (array[..., 0] - camera.cx_px) / camera.fx_px
    y = (array[..., 1] - camera.cy_px) / camera.fy_px
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    return np.asarray(rays @ camera_axes(gimbal_pitch_rad, roll_rad).T)


def ground_points(
    pixels: ArrayLike, camera: CameraModel, gimbal_pitch_rad: float, height_m: float
) -> NDArray[np.float64]:
    """Return where pixels, (..., 2), see a level plane at a height below the camera.

    (..., 2) metres forward and right of the point below the camera; NaN where a ray does not go
    down.
    """
    if not height_m > 0.0:
        raise ValueRangeError(f"the camera must be above the plane, got {height_m} m")
    rays = pixel_rays(pixels, camera, gimbal_pitch_rad)
    down = np.where(rays[..., 2] > 1e-9, rays[..., 2], np.nan)
    return np.asarray(rays[..., :2] * (height_m / down)[..., None])


def project(
    points: ArrayLike, camera: CameraModel, gimbal_pitch_rad: float, roll_rad: float = 0.0
) -> NDArray[np.float64]:
    """Return points of the level frame, (..., 3), as pixels (..., 2); NaN behind the camera."""
    array = np.asarray(points, dtype=np.float64)
    in_camera = array @ camera_axes(gimbal_pitch_rad, roll_rad)
    depth = np.where(in_camera[..., 2] > 1e-9, in_camera[..., 2], np.nan)
    column = camera.fx_px * in_camera[..., 0] / depth + camera.cx_px
    row = camera.fy_px * in_camera[..., 1] / depth + camera.cy_px
    return np.stack([column, row], axis=-1)


def elevation_to_row(elevation_rad: float, camera: CameraModel, gimbal_pitch_rad: float) -> float:
    """Return the row of the central column at which a ray has this elevation (negative: down).

    For a ray beside or behind the camera the row lies far outside the image.
    """
    below_axis_rad = clamp(gimbal_pitch_rad - elevation_rad, _BESIDE_RAD)
    return camera.cy_px + camera.fy_px * math.tan(below_axis_rad)


def ground_range_to_row(
    range_m: float, camera: CameraModel, gimbal_pitch_rad: float, height_m: float
) -> float:
    """Return the row of the central column that sees the ground at this distance ahead."""
    return elevation_to_row(-math.atan2(height_m, range_m), camera, gimbal_pitch_rad)
