"""Ground-plane visual odometry: dead reckoning, corrected by what the camera sees of the carpet.

The drone's own velocity is off by a centimetre a second for seconds on end, which adds up to a
quarter of a metre in half a minute. The carpet stands still: followed from frame to frame it tells
how far the camera really moved. The heading stays telemetry's, whose error is bounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.odometry.planar_flow import GroundView, OdometryConfig, ground_motion
from uav_bt.classes import CARPET
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, Pose2D, rotate
from uav_bt.types.dead_reckoning import Odometry, OdometryPose


@dataclass(frozen=True, kw_only=True)
class CarpetOdometryConfig:
    """Which frames are compared."""

    width_px: int = 320  # of the images that points are followed in; a larger one only costs time
    max_gap_s: float = 0.5  # between two frames; telemetry alone after a longer one
    min_height_m: float = 0.5  # of the camera; lower the carpet rushes by
    following: OdometryConfig = field(default_factory=OdometryConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """A frame that the next is compared with."""

    view: GroundView
    carpet: NDArray[np.uint8]
    lens: OdometryPose  # by telemetry alone


class CarpetOdometry:
    """Integrates telemetry, and corrects it by every frame that shows enough carpet."""

    def __init__(self, config: CarpetOdometryConfig | None = None) -> None:
        self._config = config or CarpetOdometryConfig()
        self._odometry = Odometry()
        self._last: _Sight | None = None
        self._drift_m = np.zeros(2)  # to add to telemetry's positions

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first telemetry."""
        return self._corrected(self._odometry.now)

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose of a moment of the last seconds, None before the first telemetry."""
        return self._corrected(self._odometry.at(time_s))

    def predict(self, state: DroneState) -> OdometryPose | None:
        """Follow the drone's own motion up to a telemetry sample; return the pose then."""
        self._odometry.update(state)
        return self.now

    def see(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Correct the pose by what a frame shows of the carpet.

        Args:
            class_map: made from `frame`.
            frame: the newest; its telemetry says how the camera looked.
            camera: intrinsics at any size of the same shape.
        """
        before, self._last = self._last, self._sight(class_map, frame, camera)
        if before is None or self._last is None:
            return
        if not 0.0 < self._last.lens.time_s - before.lens.time_s <= self._config.max_gap_s:
            return
        reckoned = _between(before.lens, self._last.lens)
        measured = ground_motion(
            before.view, self._last.view, reckoned, before.carpet, self._config.following
        )
        if measured is None:
            return
        forward_m, right_m = measured.x_m - reckoned.x_m, measured.y_m - reckoned.y_m
        self._drift_m += rotate(forward_m, right_m, before.lens.yaw_rad)

    def _sight(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> _Sight | None:
        pose, height_m = self._odometry.at(frame.captured_s), frame.height_above_carpet_m
        if pose is None or not height_m >= self._config.min_height_m:
            return None
        height_px, width_px = frame.image.shape[:2]
        small_px = min(width_px, self._config.width_px)
        size = (small_px, round(height_px * small_px / width_px))
        # Grey after shrinking: a quarter of the pixels to convert.
        small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
        carpet = (class_map.ids == CARPET).astype(np.uint8)
        x_m, y_m = pose.to_world(camera.forward_offset_m, 0.0)
        return _Sight(
            view=GroundView(
                grey=np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8),
                camera=camera.resized(*size),
                gimbal_pitch_rad=frame.gimbal_pitch_rad,
                height_m=height_m,
            ),
            carpet=np.asarray(
                cv2.resize(carpet, size, interpolation=cv2.INTER_NEAREST_EXACT), dtype=np.uint8
            ),
            lens=replace(pose, x_m=x_m, y_m=y_m),
        )

    def _corrected(self, pose: OdometryPose | None) -> OdometryPose | None:
        if pose is None:
            return None
        x_m, y_m = self._drift_m
        return replace(pose, x_m=pose.x_m + x_m, y_m=pose.y_m + y_m)


def _between(first: Pose2D, second: Pose2D) -> Pose2D:
    """Return the second pose as seen from the first."""
    forward_m, right_m = first.to_body(second.x_m, second.y_m)
    turn_rad = math.remainder(second.yaw_rad - first.yaw_rad, 2.0 * math.pi)
    return Pose2D(x_m=forward_m, y_m=right_m, yaw_rad=turn_rad)
