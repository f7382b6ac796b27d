"""Class maps of known geometry: boxes' fronts and ground, cast ray by ray."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.paper_lab import BACKGROUND, BOXES, CARPET, paper_map
from uav_bt.protocols import PolicyView
from uav_bt.types import CameraModel
from uav_bt.types.projection import ground_points, pixel_rays

# The ANAFI's video, resized to the network's size.
CAMERA = CameraModel(
    width_px=640, height_px=360, fx_px=465.6, fy_px=465.6, cx_px=319.5, cy_px=179.5
).resized(224, 112)
PITCH_RAD = math.radians(-30)
HEIGHT_M = 1.5
FOR_EVER = 1e3
HIGH_M = 2.2  # of a box that reaches above the flight altitude

Box = tuple[float, float, float]  # front face: metres ahead of the camera, its left and right ends


def cast(
    boxes: Sequence[Box] = (),
    *,
    ground_m: float = FOR_EVER,
    slant: float = 0.0,
    camera: CameraModel = CAMERA,
    pitch_rad: float = PITCH_RAD,
    height_m: float = HEIGHT_M,
    thing: int = BOXES[2],
) -> NDArray[np.uint8]:
    """Ray-cast boxes' fronts and ground as far as forward + slant * right < ground_m."""
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    pixels = np.stack([columns, rows], axis=-1)
    ground = ground_points(pixels, camera, pitch_rad, height_m)
    ids = np.full(rows.shape, BACKGROUND, dtype=np.uint8)
    ids[ground[..., 0] + slant * ground[..., 1] < ground_m] = CARPET
    rays = pixel_rays(pixels, camera, pitch_rad)
    for ahead_m, left_m, right_m in boxes:
        scale = ahead_m / rays[..., 0]
        across, down = scale * rays[..., 1], scale * rays[..., 2]
        hit = (across >= left_m) & (across <= right_m)
        ids[hit & (down <= height_m) & (down >= height_m - HIGH_M)] = thing
    return ids


def view(
    ids: NDArray[np.uint8], *, camera: CameraModel = CAMERA, tie_break: float = 0.9, **seen: Any
) -> PolicyView:
    """Return the view that shows these class ids."""
    return PolicyView(
        class_map=paper_map(ids=ids, captured_s=0.0),
        camera=camera,
        gimbal_pitch_rad=PITCH_RAD,
        height_above_ground_m=HEIGHT_M,
        tie_break=tie_break,
        **seen,
    )
