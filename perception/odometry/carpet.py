"""Dead reckoning in flight, corrected by every frame that shows enough carpet."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.odometry.height import SmoothHeight
from perception.odometry.velocity_error import VelocityError, VelocityErrorConfig
from perception.odometry.visual import GroundView, OdometryConfig, ground_motion
from uav_bt.classes import CARPET
from uav_bt.types import (
    BodyVelocity,
    CameraModel,
    ClassMap,
    DroneState,
    Frame,
    Pose2D,
    rotate,
    rotate_points,
)
from uav_bt.types.dead_reckoning import MotionEstimate, Odometry, OdometryPose

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class CarpetOdometryConfig:
    """Which frames are compared."""

    width_px: int = 320  # of the images that points are followed in; a larger one only costs time
    border_px: int = 2  # carpet so near to something else is left out: its corners are the other's
    max_gap_s: float = 0.5  # between two frames; telemetry alone after a longer one
    min_height_m: float = 0.5  # of the camera; lower the carpet rushes by
    following: OdometryConfig = field(default_factory=OdometryConfig)
    error: VelocityErrorConfig = field(default_factory=VelocityErrorConfig)


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
        self._drift_m = np.zeros(2)  # to add to telemetry's positions when the last frame was seen
        self._seen_s = -math.inf  # capture of that frame
        self._tracked_s = -math.inf  # of the last frame whose ground was followed
        self._error = VelocityError(self._config.error)
        self._height = SmoothHeight()

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose, None before the first telemetry."""
        return self._corrected(self._odometry.now)

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose of a moment of the last seconds, None before the first telemetry."""
        return self._corrected(self._odometry.at(time_s))

    @property
    def estimate(self) -> MotionEstimate | None:
        """How the drone moves over the ground; None before the first frame and telemetry."""
        pose, seen = self.now, self.at(self._seen_s)
        if pose is None or seen is None or math.isinf(self._seen_s):
            return None
        reported, (x_mps, y_mps) = self._odometry.velocity, map(float, self._error.mps)
        forward_mps, right_mps = rotate(x_mps, y_mps, -pose.yaw_rad)
        return MotionEstimate(
            pose=pose,
            seen=seen,
            velocity=BodyVelocity(
                forward_mps=reported.forward_mps + forward_mps,
                right_mps=reported.right_mps + right_mps,
                down_mps=reported.down_mps,
            ),
            error=BodyVelocity(forward_mps=forward_mps, right_mps=right_mps),
            tracked_s=self._tracked_s,
        )

    def predict(self, state: DroneState) -> OdometryPose | None:
        """Follow the drone's own motion up to a telemetry sample; return the pose then."""
        self._odometry.update(state)
        self._height.predict(state)
        return self.now

    def see(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Correct the pose by what a frame shows of the carpet.

        Args:
            class_map: made from `frame`.
            frame: the newest; its telemetry says how the camera looked.
            camera: intrinsics at any size of the same shape.
        """
        before, self._last = self._last, self._sight(class_map, frame, camera)
        passed_s = max(0.0, frame.captured_s - self._seen_s)
        self._seen_s = frame.captured_s
        if math.isinf(passed_s):
            return
        self._error.predict(passed_s)
        shift_m = self._missed(before)
        if shift_m is None:
            self._drift_m += self._error.mps * passed_s  # what telemetry misses goes on
            return
        self._drift_m += shift_m
        self._tracked_s = frame.captured_s
        self._error.correct(shift_m / passed_s, passed_s)

    def _missed(self, before: _Sight | None) -> Floats | None:
        """Return by how much telemetry is wrong about the way from one frame to the last, (2,)."""
        if before is None or self._last is None:
            return None
        passed_s = self._last.lens.time_s - before.lens.time_s
        if not 0.0 < passed_s <= self._config.max_gap_s:
            return None
        reckoned = _between(before.lens, self._last.lens)
        error_m = rotate_points(self._error.mps * passed_s, -before.lens.yaw_rad)
        expected = replace(
            reckoned, x_m=reckoned.x_m + float(error_m[0]), y_m=reckoned.y_m + float(error_m[1])
        )
        measured = ground_motion(
            before.view, self._last.view, expected, before.carpet, self._config.following
        )
        if measured is None:
            return None
        missed_m = measured.x_m - reckoned.x_m, measured.y_m - reckoned.y_m
        return np.array(rotate(*missed_m, before.lens.yaw_rad))

    def _sight(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> _Sight | None:
        pose, height_m = self._odometry.at(frame.captured_s), self._height.see(frame)
        if pose is None or not height_m >= self._config.min_height_m:
            return None
        height_px, width_px = frame.image.shape[:2]
        small_px = min(width_px, self._config.width_px)
        size = (small_px, round(height_px * small_px / width_px))
        # Grey after shrinking: a quarter of the pixels to convert.
        small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
        carpet = cv2.resize(
            (class_map.ids == CARPET).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT
        )
        around = np.ones((2 * self._config.border_px + 1,) * 2, dtype=np.uint8)
        x_m, y_m = pose.to_world(camera.forward_offset_m, 0.0)
        return _Sight(
            view=GroundView(
                grey=np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8),
                camera=camera.resized(*size),
                gimbal_pitch_rad=frame.gimbal_pitch_rad,
                height_m=height_m,
            ),
            carpet=np.asarray(cv2.erode(carpet, around), dtype=np.uint8),
            lens=replace(pose, x_m=x_m, y_m=y_m),
        )

    def _corrected(self, pose: OdometryPose | None) -> OdometryPose | None:
        if pose is None:
            return None
        since_s = 0.0 if math.isinf(self._seen_s) else pose.time_s - self._seen_s
        x_m, y_m = self._drift_m + self._error.mps * since_s
        return replace(pose, x_m=pose.x_m + float(x_m), y_m=pose.y_m + float(y_m))


def _between(first: Pose2D, second: Pose2D) -> Pose2D:
    """Return the second pose as seen from the first."""
    forward_m, right_m = first.to_body(second.x_m, second.y_m)
    turn_rad = math.remainder(second.yaw_rad - first.yaw_rad, 2.0 * math.pi)
    return Pose2D(x_m=forward_m, y_m=right_m, yaw_rad=turn_rad)
