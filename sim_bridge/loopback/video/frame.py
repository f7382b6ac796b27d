"""Frames of the video: an image, and the telemetry of the moment it was captured."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.world import Location
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import Attitude, FlyingState


@dataclass(frozen=True, kw_only=True)
class NorthEastDown:
    """A vector in the earth's frame: metres, or metres a second."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0


@dataclass(frozen=True, kw_only=True)
class VideoFrame:
    """One image of the camera, with the telemetry of the moment it was captured."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB
    captured_s: float  # s of the server's monotonic clock; a new frame has a new time
    captured_utc_s: float | None = None  # the same moment since the epoch, where it is known
    attitude: Attitude = field(default_factory=Attitude)  # of the body; yaw clockwise from north
    camera: Attitude = field(default_factory=Attitude)  # of the view, in the same frame
    velocity_mps: NorthEastDown = field(default_factory=NorthEastDown)
    position_m: NorthEastDown = field(default_factory=NorthEastDown)  # from the take-off point
    location: Location | None = None
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    battery: float = 1.0  # 0 to 1
    flying: FlyingState = FlyingState.LANDED
    fov_rad: tuple[float, float] = (0.0, 0.0)  # horizontal, vertical; 0 where it is not known

    def __post_init__(self) -> None:
        if self.image.ndim != 3 or self.image.shape[2] != 3 or 0 in self.image.shape:
            raise ShapeError("video image", expected="HxWx3", actual=self.image.shape)
        if self.image.dtype != np.uint8:
            raise ValueRangeError(f"a video image holds uint8, got {self.image.dtype}")
        if not 0.0 <= self.battery <= 1.0:
            raise ValueRangeError(f"battery must lie within 0 and 1, got {self.battery}")


class FrameSource(Protocol):
    """Where frames come from."""

    def newest(self) -> VideoFrame | None:
        """Return the newest frame, None before the first.

        Called on the video's own thread and only while a client plays; it may take its time, for
        instance to render now. A frame that was returned before is recognised by its time and not
        sent again.
        """
