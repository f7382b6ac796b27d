"""The ground plane in the image: its depth at every pixel.

Level frames are at the lens: x forward, y right, z down. Two distances are distinguished:

*depth*  along the optical axis; networks predict it, and the twin's truth holds it;
*range*  along the pixel's ray, the Euclidean distance; a tape measure gives it, and in the paper it
         is the distance between P'' and the camera (Mocanu et al., equations 4 to 9).

The paper's equation 9 is ``lambda = x_t / (x_t - x')`` with x up: the height divided by the descent
of the ray per unit of lambda. For rays of unit depth, lambda is the depth, and the range is lambda
times the ray's length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel, Frame
from uav_bt.types.arrays import Floats32
from uav_bt.types.projection import camera_axes

_LEVEL = 1e-6  # rays that descend less than this per unit of depth never meet the ground


@dataclass(frozen=True, kw_only=True)
class CameraView:
    """Height and attitude of the lens above the ground."""

    camera: CameraModel  # at the size of the class or depth map; undistorted
    pitch_rad: float  # of the optical axis to the horizon, negative down
    height_m: float  # of the lens above the ground
    roll_rad: float = 0.0  # of the image, right side down positive; no supported drone reports it

    def __post_init__(self) -> None:
        if not (math.isfinite(self.height_m) and abs(self.pitch_rad) <= math.pi / 2 + 1e-6):
            raise ValueRangeError(
                "a view needs a finite height, and a pitch within -pi/2 and pi/2 rad, got "
                f"{self.height_m} m and {self.pitch_rad} rad"
            )


def view_of(frame: Frame, camera: CameraModel, size_px: tuple[int, int]) -> CameraView:
    """Return the view from a frame's telemetry, for maps of a width and height.

    The gimbal holds its pitch at any attitude of the body, which matters only for the lever: the
    lens is ahead of the body's centre and moves up and down with the nose.
    """
    lever_m = camera.forward_offset_m * math.sin(frame.attitude.pitch_rad)
    return CameraView(
        camera=camera.resized(*size_px),
        pitch_rad=frame.gimbal_pitch_rad,
        height_m=frame.height_above_ground_m + lever_m,
    )


def level_rays(view: CameraView) -> Floats32:
    """Return every pixel's ray of unit depth in the level frame (equations 4 to 7).

    (3, H, W): forward, right, down. A point at depth d of a pixel is d times its ray.
    """
    camera = view.camera
    across = (np.arange(camera.width_px) - camera.cx_px) / camera.fx_px
    along = (np.arange(camera.height_px) - camera.cy_px) / camera.fy_px
    axes = camera_axes(view.pitch_rad, view.roll_rad)
    # Each component is a plane over the image: the outer sum of a row and a column.
    columns = (axes[:, :1] * across).astype(np.float32)
    rows = (axes[:, 1:2] * along + axes[:, 2:]).astype(np.float32)
    return np.asarray(columns[:, None, :] + rows[:, :, None])


def ray_lengths(camera: CameraModel) -> Floats32:
    """Return the length of every pixel's ray of unit depth, (H, W): range over depth."""
    across = (np.arange(camera.width_px) - camera.cx_px) / camera.fx_px
    along = (np.arange(camera.height_px) - camera.cy_px) / camera.fy_px
    return np.sqrt(across[None, :] ** 2 + along[:, None] ** 2 + 1.0).astype(np.float32)


def ground_depth(
    view: CameraView, *, plane_m: float = 0.0, rays: Floats32 | None = None
) -> Floats32:
    """Return the depth at which each pixel's ray meets a level plane (equations 8 and 9).

    (H, W) metres along the optical axis; NaN where the ray does not meet the plane. `plane_m` is
    the plane's height above the ground, such as that of the landing mark's top; `rays` are the
    view's, if already computed. ValueRangeError if the lens is not above the plane.
    """
    above_m = view.height_m - plane_m
    if not above_m > 0.0:
        raise ValueRangeError(
            f"the lens must be above the plane it looks at, got {view.height_m:.3f} m above the "
            f"ground with the plane at {plane_m:.3f} m"
        )
    down = (level_rays(view) if rays is None else rays)[2]
    depth = np.full(down.shape, np.nan, dtype=np.float32)
    np.divide(np.float32(above_m), down, out=depth, where=down > _LEVEL)
    return depth


class GroundPlane(NamedTuple):
    """The ground in one view, computed once for all users."""

    view: CameraView
    rays: Floats32  # (3, H, W), `level_rays`
    depth_m: Floats32  # (H, W), `ground_depth`

    @classmethod
    def of(cls, view: CameraView) -> GroundPlane:
        """Return the ground in a view; ValueRangeError if the lens is not above the ground."""
        rays = level_rays(view)
        return cls(view, rays, ground_depth(view, rays=rays))
