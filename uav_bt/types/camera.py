"""Cameras, their frames, and the results of perception on one frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.classes import GROUND, MARK, LabClasses
from uav_bt.settings import brief_repr
from uav_bt.types.drone_state import Attitude


@dataclass(frozen=True, kw_only=True)
class CameraModel:
    """A pinhole camera in OpenCV's frame (x right, y down, z forward)."""

    width_px: int  # image size of the calibration
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()  # OpenCV's k1, k2, p1, p2, k3, ...; empty means none
    forward_offset_m: float = 0.15  # lens ahead of the body's centre; the ANAFI's

    def __post_init__(self) -> None:
        if self.width_px <= 0 or self.height_px <= 0 or self.fx_px <= 0 or self.fy_px <= 0:
            got = f"{self.width_px}x{self.height_px}, f = ({self.fx_px}, {self.fy_px})"
            raise ValueRangeError(f"camera size and focal lengths must be positive, got {got}")

    @property
    def pinhole_px(self) -> tuple[float, float, float, float]:
        """Focal lengths and principal point, px: fx, fy, cx, cy."""
        return self.fx_px, self.fy_px, self.cx_px, self.cy_px

    @property
    def matrix(self) -> NDArray[np.float64]:
        """OpenCV's camera matrix, (3, 3)."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0.0, 0, 1]])

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
class FrameNote:
    """A camera frame without its image: the telemetry of the moment it was captured."""

    index: int  # number of the captured frame; identifies repeated frames
    captured_s: float
    gimbal_pitch_rad: float  # 0 level, negative down; stabilised, so relative to the horizon
    attitude: Attitude = field(default_factory=Attitude)
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    height_above_ground_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Frame(FrameNote):
    """One camera image with its telemetry."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        check_shape("frame image", self.image, 3, 3)


@dataclass(frozen=True, kw_only=True)
class ClassMap:
    """A class id for every pixel of a (resized) frame."""

    ids: NDArray[np.uint8]  # (H, W)
    classes: LabClasses  # `classes.names` has the names by id
    captured_s: float  # of the frame

    __repr__ = brief_repr

    @cached_property
    def roles(self) -> NDArray[np.uint8]:
        """The roles of the pixels, (H, W) uint8 of `uav_bt.lab.classes`."""
        return self.classes.roles(self.ids)

    @cached_property
    def is_ground(self) -> NDArray[np.bool_]:
        """Where the ground is, (H, W)."""
        return np.asarray(self.roles == GROUND)

    @cached_property
    def is_above_ground(self) -> NDArray[np.bool_]:
        """Where obstacles or the landing mark are, (H, W)."""
        return np.asarray(self.roles >= MARK)

    def __post_init__(self) -> None:
        check_shape("class map", self.ids, 2)


@dataclass(frozen=True, kw_only=True)
class DepthMap:
    """Depth along the optical axis for every pixel of a (resized) frame."""

    depth: NDArray[np.float32]  # (H, W); metres when metric, arbitrary unit when relative
    metric: bool
    captured_s: float
    confidence: float = 1.0  # 0 to 1
    # Whether the unit of relative depth is the camera's height above the ground.
    in_heights: bool = False
    # (H, W) metres: an upper bound, also if the depth is unknown (NaN); inf without one.
    at_most: NDArray[np.float32] | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        check_shape("depth map", self.depth, 2)


@dataclass(frozen=True, kw_only=True)
class Corridor:
    """Obstacles in the five-plane safety corridor, from a depth map."""

    captured_s: float
    free_distance_m: float  # straight ahead, from the body's centre
    nearest_m: float  # nearest intrusion from the body's centre; inf without one
    nearest_side: Literal["left", "right", "front", "up", "down"] | None
    time_to_impact_s: float  # at the present speed; inf when nothing is ahead
    nearest_left_m: float = math.inf  # nearest intrusion left of the path; inf without one
    nearest_right_m: float = math.inf
    unknown_px: int = 0  # pixels of unknown depth that may be in the corridor


def check_shape(name: str, array: NDArray[np.generic], ndim: int, last: int | None = None) -> None:
    """Raise ShapeError unless the array has `ndim` dimensions and, if given, `last` channels."""
    if array.ndim != ndim or (last is not None and array.shape[-1] != last):
        dims = "x".join(["H", "W"][:ndim] + ([str(last)] if last else []))
        raise ShapeError(name, expected=dims, actual=array.shape)
