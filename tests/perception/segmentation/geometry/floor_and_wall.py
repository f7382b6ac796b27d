"""A textured floor and a wall, seen by a camera: frames with exact views, motions and labels."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, level_rays
from perception.segmentation.geometry.plane_sweep import Map
from sim_bridge.anafi import anafi_camera
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import camera_axes

SIZE_PX = (224, 112)
PITCH_RAD = math.radians(-15.0)
HEIGHT_M = 1.5
WALL_M = 2.6  # ahead of the origin
_CELLS_A_METRE = 25.0


def view() -> CameraView:
    """Return the view of every frame."""
    camera = anafi_camera(640, 360).resized(*SIZE_PX)
    return CameraView(camera=camera, pitch_rad=PITCH_RAD, height_m=HEIGHT_M)


def frame(right_m: float, *, contrast: float = 1.0, seed: int = 0) -> tuple[Map, NDArray[np.bool_]]:
    """Return the frame of a camera that is shifted to the right, and where it shows the floor.

    Args:
        right_m: Place of the lens.
        contrast: Of floor and wall; 0 for none.
        seed: Of the noise.
    """
    rays = level_rays(view())
    floor = HEIGHT_M / np.where(rays[2] > 1e-6, rays[2], np.nan)
    wall = WALL_M / rays[0]
    on_floor = np.nan_to_num(floor, nan=np.inf) < wall
    depth = np.where(on_floor, floor, wall)
    points = rays * depth
    across = points[1] + right_m
    along = np.where(on_floor, points[0], points[2] + 40.0)
    generator = np.random.default_rng(7)
    texture = generator.normal(0.0, 40.0, (2048, 512)).astype(np.float32)
    texture = cv2.GaussianBlur(texture, (5, 5), 1.0) * 3.0
    shown = cv2.remap(
        texture,
        (across * _CELLS_A_METRE + 256.0).astype(np.float32),
        (along * _CELLS_A_METRE).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    noise = np.random.default_rng(seed).normal(0.0, 1.0, shown.shape)
    return (128.0 + contrast * shown + noise).astype(np.float32), on_floor


def motion(right_m: float) -> Floats:
    """Return the transform of points from the camera at the origin to one shifted to the right."""
    axes = camera_axes(PITCH_RAD)
    return np.column_stack([np.eye(3), axes.T @ np.array([0.0, -right_m, 0.0])])
