"""Cameras, and the images they take."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.types.shapes import check_shape
from uav_bt.types.telemetry import Attitude


@dataclass(frozen=True, kw_only=True)
class CameraModel:
    """A pinhole camera in OpenCV's frame (x right, y down, z forward)."""

    width_px: int  # the size this calibration was made at
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()  # OpenCV's k1, k2, p1, p2, k3, ...; empty means none
    forward_offset_m: float = 0.15  # lens ahead of the body's centre; the ANAFI's

    def __post_init__(self) -> None:
        if self.width_px <= 0 or self.height_px <= 0 or self.fx_px <= 0 or self.fy_px <= 0:
            raise ValueRangeError(
                "camera size and focal lengths must be positive, got "
                f"{self.width_px}x{self.height_px}, f = ({self.fx_px}, {self.fy_px})"
            )

    def resized(self, width_px: int, height_px: int) -> CameraModel:
        """Return the intrinsics of the same image resized (not cropped) to another size.

        A resize that changes the aspect (640x360 to the network's 224x112) gives unequal focal
        lengths, which is exact for a resized image. Pixel centres are at integer coordinates, as in
        OpenCV.
        """
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return CameraModel(
            width_px=width_px,
            height_px=height_px,
            fx_px=self.fx_px * sx,
            fy_px=self.fy_px * sy,
            cx_px=(self.cx_px + 0.5) * sx - 0.5,
            cy_px=(self.cy_px + 0.5) * sy - 0.5,
            distortion=self.distortion,
            forward_offset_m=self.forward_offset_m,
        )


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One camera image with the telemetry of the moment it was captured."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB
    index: int  # counts captured frames, so that a repeated frame is recognised
    captured_s: float
    gimbal_pitch_rad: float  # 0 level, negative down; stabilised, so relative to the horizon
    attitude: Attitude = field(default_factory=Attitude)
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    height_above_carpet_m: float = 0.0

    def __post_init__(self) -> None:
        check_shape("frame image", self.image, 3, 3)
