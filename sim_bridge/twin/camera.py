"""The twin's camera: intrinsics like the ANAFI's video, and where it is when the drone is there."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel

__all__ = ["CAMERA_FORWARD_M", "CameraPose", "anafi_camera"]

CAMERA_FORWARD_M = 0.15  # the lens ahead of the body's centre
FOCAL_SHARE = 0.7275  # focal length over image width: 69 degrees wide, the ANAFI's video


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraPose:
    """Where the lens is and where it looks; the gimbal keeps the horizon level."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float  # counter-clockwise from +x
    pitch_rad: float  # 0 level, negative down

    def axes(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the optical axis and the image's upward direction in the world."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return (cp * cy, cp * sy, sp), (-sp * cy, -sp * sy, cp)


def anafi_camera(width_px: int, height_px: int) -> CameraModel:
    """Return the intrinsics of the simulated video at a size.

    Args:
        width_px: image width.
        height_px: image height; the aspect must be 16:9 (to the nearest pixel).

    Raises:
        ValueRangeError: the aspect is another, or the size is not positive.
    """
    if width_px < 16 or abs(height_px - width_px * 9 / 16) > 1.0:
        raise ValueRangeError(
            "the twin's video is 16:9 (640x360, 320x180, 1152x648, ...), "
            f"got {width_px}x{height_px}"
        )
    focal = FOCAL_SHARE * width_px
    return CameraModel(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        forward_offset_m=CAMERA_FORWARD_M,
    )
