"""A flight's frames, at the depth network's size, with the telemetry that came with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import CameraModel

FOOTAGE_SIZE_PX: Final = (320, 256)  # width, height: SC-Depth's size for indoor video

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Footage:
    """One flight's video and telemetry; all times are of the flight's clock."""

    frames: NDArray[np.uint8]  # (N, H, W, 3) RGB, resized, never cropped
    index: NDArray[np.int64]  # (N,), the drone's frame numbers, rising
    captured_s: Floats  # (N,), rising
    gimbal_pitch_rad: Floats  # (N,), relative to the horizon
    attitude_rad: Floats  # (N, 3): roll, pitch, yaw (clockwise) at capture
    altitude_m: Floats  # (N,), above the take-off point
    height_m: Floats  # (N,), above the surface below
    height_above_carpet_m: Floats  # (N,), of the body's centre
    # Telemetry of every tick: it arrives sooner than the frames and is matched to them by time.
    state_s: Floats  # (M,), rising
    state_attitude_rad: Floats  # (M, 3)
    velocity_mps: Floats  # (M, 3): forward, right, down in the heading-aligned body frame
    camera: CameraModel  # at the frames' size

    def __post_init__(self) -> None:
        count, ticks = len(self.captured_s), len(self.state_s)
        if self.frames.ndim != 4 or self.frames.shape[3] != 3 or self.frames.dtype != np.uint8:
            raise ShapeError("footage frames", expected="NxHxWx3 uint8", actual=self.frames.shape)
        wanted = {
            "frames": (count, self.camera.height_px, self.camera.width_px, 3),
            "attitude_rad": (count, 3),
            "state_attitude_rad": (ticks, 3),
            "velocity_mps": (ticks, 3),
            **dict.fromkeys(_PER_FRAME, (count,)),
            "state_s": (ticks,),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if array.shape != shape:
                expected = "x".join(map(str, shape))
                raise ShapeError(f"footage {name}", expected=expected, actual=array.shape)
            if not np.isfinite(array).all():
                raise ValueRangeError(f"footage {name} holds NaN or infinity")
        for name in ("index", "captured_s", "state_s"):
            if (np.diff(getattr(self, name)) <= 0).any():
                raise ValueRangeError(f"footage {name} must rise from entry to entry")

    def __len__(self) -> int:
        return len(self.frames)


_PER_FRAME: Final = (
    *("index", "captured_s", "gimbal_pitch_rad", "altitude_m", "height_m"),
    "height_above_carpet_m",
)


def shrink(
    image: NDArray[np.uint8], size_px: tuple[int, int] = FOOTAGE_SIZE_PX
) -> NDArray[np.uint8]:
    """Resize an image, (H, W, 3), by area to a width and height; it is never cropped."""
    if image.shape[1::-1] == size_px:
        return image
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)
