"""A frame's metadata, from the SDK's dictionary.

The SDK writes what came with a frame as JSON, in one of two shapes: newer firmware sends a message
with `drone` and `camera`, older a flat record (versions 2 and 3). Read from libvideo-metadata's
output in the wheels parrot-olympe 7.7.5 and 8.5.0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from uav_bt.types import Attitude


@dataclass(frozen=True, kw_only=True)
class FrameMetadata:
    """The telemetry of a frame's capture; None where the frame does not have it."""

    attitude: Attitude | None = None
    gimbal_pitch_rad: float | None = None
    height_m: float | None = None  # above the surface below
    altitude_m: float | None = None  # above the take-off point
    captured_us: int | None = None  # of the camera's clock


def frame_metadata(vmeta: Mapping[str, Any]) -> FrameMetadata:
    """Return the metadata of a frame.

    Args:
        vmeta: the SDK's dictionary; unknown and missing entries are no error.
    """
    drone, camera = _mapping(vmeta.get("drone")), _mapping(vmeta.get("camera"))
    if not drone and not camera:  # the flat record
        drone = {"quat": vmeta.get("drone_quat"), "ground_distance": vmeta.get("ground_distance")}
        camera = {"quat": vmeta.get("frame_quat")}
    attitude, view = _attitude(drone.get("quat")), _attitude(camera.get("quat"))
    captured = _number(camera.get("timestamp"))
    return FrameMetadata(
        attitude=attitude,
        gimbal_pitch_rad=None if view is None else view.pitch_rad,
        height_m=_number(drone.get("ground_distance")),
        altitude_m=_number(drone.get("altitude_ato")),
        captured_us=None if not captured else int(captured),
    )


def _attitude(quaternion: Any) -> Attitude | None:
    """Return roll, pitch and yaw of a rotation from body to north-east-down, None without one."""
    parts = _mapping(quaternion)
    numbers = [_number(parts.get(name)) for name in "wxyz"]
    w, x, y, z = (0.0 if number is None else number for number in numbers)
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if length < 0.5:  # all zero: not known to the firmware
        return None
    w, x, y, z = w / length, x / length, y / length, z / length
    return Attitude(
        roll_rad=math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        pitch_rad=math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))),
        yaw_rad=math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _number(value: Any) -> float | None:
    known = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if known and math.isfinite(value) else None
