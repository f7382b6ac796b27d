"""Sightings of a landing mark by a finder in images, for frames that show nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import CameraModel
from uav_bt.types.projection import camera_axes, project

_VIDEO = anafi_camera(640, 360)
_SAME = 0.9  # least share of the expected depth at which nothing is in between. Chosen.
_TOP_SHARE = 0.6  # side of a mark without a stated size over the side of the top. Chosen.


@dataclass(frozen=True, kw_only=True)
class MarkErrors:
    """Errors of a finder in images: those that `benchmarks/landing_marks.py views` shows for tags.

    Attributes:
        range_share: Standard deviation of the range, as a share of it.
        bearing_rad: Standard deviation of the bearing.
        heading_deg: Standard deviation of the heading, at `sure_px` and above.
        min_px: Least side of a tag in the video that is found, pixels of 640x360.
        sure_px: Least side of full confidence. The errors of a smaller one are larger by this side
            over its own.
    """

    range_share: float = 0.01
    bearing_rad: float = 0.001
    heading_deg: float = 0.3
    min_px: float = 10.0
    sure_px: float = 16.0


def see_mark(
    pad: Helipad, camera: CameraPose, errors: MarkErrors, generator: np.random.Generator
) -> MarkSighting | None:
    """Return the landing mark in a view, with errors; None if it is too small or not in view.

    Args:
        pad: The landing mark in the scene.
        camera: Pose of the lens.
        errors: Sizes of the errors.
        generator: Source of the errors of this frame.
    """
    middle, corners = _in_level_frame(pad, camera)
    pixels = project(corners, _VIDEO, camera.pitch_rad)
    inside = (pixels > -0.5) & (pixels < (_VIDEO.width_px - 0.5, _VIDEO.height_px - 0.5))
    if not inside.all():  # NaN, behind the lens, is outside
        return None
    side_px = float(np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1).min())
    if side_px < errors.min_px:
        return None
    confidence = min(1.0, side_px / errors.sure_px)
    sizes = np.array([errors.range_share, errors.bearing_rad, errors.heading_deg]) / confidence
    stretch, aside_rad, turn_deg = generator.normal(0.0, sizes)
    range_m = math.hypot(middle[0], middle[1]) * (1.0 + stretch)
    bearing_rad = math.atan2(middle[1], middle[0]) + aside_rad
    # Yaw is counter-clockwise, a heading clockwise; the upper edge is towards the pad's y axis.
    heading_deg = pad.yaw_deg + 90.0 - math.degrees(camera.yaw_rad) + float(turn_deg)
    return MarkSighting(
        forward_m=range_m * math.cos(bearing_rad) + CAMERA_FORWARD_M,
        right_m=range_m * math.sin(bearing_rad),
        height_m=pad.size_m[2],
        confidence=confidence,
        heading_deg=math.remainder(heading_deg, 360.0),
    )


def is_covered(
    pad: Helipad, camera: CameraPose, depth_m: NDArray[np.float32], lens: CameraModel
) -> bool:
    """Return whether something nearer hides the middle of the mark, or the view does not have it.

    Args:
        pad: The landing mark in the scene.
        camera: Pose of the lens.
        depth_m: (H, W) depth of the view along the optical axis, metres.
        lens: Intrinsics at that size.
    """
    middle, _ = _in_level_frame(pad, camera)
    column, row = project(middle, lens, camera.pitch_rad)
    if not (0.0 <= column <= lens.width_px - 1 and 0.0 <= row <= lens.height_px - 1):
        return True
    expected_m = float((middle @ camera_axes(camera.pitch_rad))[2])
    return bool(depth_m[round(row), round(column)] < _SAME * expected_m)


def _sides_m(pad: Helipad) -> NDArray[np.float64]:
    """Return the sides of the mark along the pad's axes, (2,): those of its largest tag."""
    tags = pad.options.get("tags") or [pad.options]
    sides_m = [float(tag["size_m"]) for tag in tags if "size_m" in tag]
    if not sides_m:
        return _TOP_SHARE * np.array(pad.size_m[:2])
    return np.full(2, max(sides_m))


def _in_level_frame(
    pad: Helipad, camera: CameraPose
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle (3,) and corners (4, 3) of the tag in the level frame of the camera."""
    cos, sin = math.cos(camera.yaw_rad), math.sin(camera.yaw_rad)
    # From the world (x, y up to the left of x) to forward and right.
    level = np.array([[cos, sin, 0.0], [sin, -cos, 0.0], [0.0, 0.0, -1.0]])
    turn = math.radians(pad.yaw_deg)
    along, across = (
        np.array([math.cos(turn), math.sin(turn)]),
        np.array([-math.sin(turn), math.cos(turn)]),
    )
    half_m = _sides_m(pad) / 2.0
    signs = ((-1, 1), (1, 1), (1, -1), (-1, -1))
    flat = [sx * half_m[0] * along + sy * half_m[1] * across for sx, sy in signs]
    top = np.array([*pad.position_m, pad.size_m[2]])
    lens = np.array([camera.x_m, camera.y_m, camera.z_m])
    corners = np.column_stack([flat, np.zeros(4)]) + top
    return np.asarray(level @ (top - lens)), np.asarray((corners - lens) @ level.T)
