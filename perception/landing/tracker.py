"""Tracker of the helipad over class maps, including frames without a detection.

The pad is fixed, so a Kalman filter with a constant state in a dead-reckoned frame is enough. The
odometry integrates the drone's velocity and yaw. Because video is late, detections are placed by
the pose at their frame's capture. The fix is given relative to the present pose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from filterpy.kalman import KalmanFilter

from perception.landing.detector import (
    HelipadDetection,
    HelipadDetector,
    locate,
    visible_share,
)
from uav_bt.errors import ValueRangeError
from uav_bt.types import (
    CameraModel,
    ClassMap,
    DroneState,
    Frame,
    HelipadFix,
    LandingMark,
    rotation,
)
from uav_bt.types.dead_reckoning import Odometry

# A smaller share of a whole H is a mask error; on boxes such errors reach 0.02. Only from right
# above the pad, within _ABOVE_M, may the visible share of the H be smaller.
_SPECK: Final = 0.1
_ABOVE_M: Final = 0.5


@dataclass(frozen=True, kw_only=True)
class HelipadTrackerConfig:
    """Noise model of the filter."""

    bearing_std_rad: float = 0.02  # about 3 pixels of a 224-wide class map
    range_std_ratio: float = 0.06  # error along the line of sight, relative to the range
    floor_std_m: float = 0.03  # error of the H's centroid at close range
    doubt_std_m: float = 0.3  # additional error, times 1 - confidence
    drift_std_mps: float = 0.05  # growth of dead reckoning's error, per square root of a second
    gate: float = 13.8  # squared Mahalanobis distance, chi-square 2 dof at 99.9 %
    rejections_to_restart: int = 5  # after this number of outliers in a row the track restarts


class HelipadTracker:
    """Fuses detections into one position of the pad."""

    def __init__(self, config: HelipadTrackerConfig | None = None) -> None:
        self._config = config or HelipadTrackerConfig()
        self._odometry = Odometry()
        self._filter: KalmanFilter | None = None
        self._filter_time_s = 0.0
        self._seen_s = -math.inf
        self._confidence = 0.0
        self._rejected = 0

    def predict(self, state: DroneState, now_s: float | None = None) -> None:
        """Integrate the drone's motion.

        Args:
            state: telemetry.
            now_s: time to which the newest pose is extrapolated, s; None for telemetry's newest
                time.
        """
        pose = self._odometry.update(state, now_s)
        if self._filter is not None:
            dt = max(0.0, pose.time_s - self._filter_time_s)
            self._filter.predict(Q=np.eye(2) * (self._config.drift_std_mps**2 * dt))
        self._filter_time_s = pose.time_s

    def update(
        self, forward_m: float, right_m: float, *, captured_s: float, confidence: float
    ) -> bool:
        """Update the track with a detection.

        Args:
            forward_m: horizontal distance ahead of the body's centre at the frame's capture.
            right_m: horizontal distance to its right.
            captured_s: capture time of the frame.
            confidence: 0 to 1; a less confident detection moves the track less.

        Returns:
            False if the detection was rejected as an outlier or came before any telemetry.

        Raises:
            ValueRangeError: a number is not finite, or the confidence is not within 0 and 1.
        """
        finite = all(map(math.isfinite, (forward_m, right_m, captured_s)))
        if not finite or not 0.0 <= confidence <= 1.0:
            raise ValueRangeError(
                "a detection must be finite and its confidence within 0 and 1, got "
                f"({forward_m}, {right_m}) m at {captured_s} s, confidence {confidence}"
            )
        pose = self._odometry.at(captured_s)
        if pose is None:
            return False
        measurement = np.array(pose.to_world(forward_m, right_m))
        noise = self._measurement_noise(forward_m, right_m, pose.yaw_rad, confidence)
        if self._filter is None or self._rejected >= self._config.rejections_to_restart:
            self._start(measurement, noise)
        elif self._distance(measurement, noise) > self._config.gate:
            self._rejected += 1
            return False
        else:
            self._filter.update(measurement, R=noise)
        self._rejected = 0
        self._seen_s = max(self._seen_s, captured_s)
        self._confidence = confidence
        return True

    def fix(self, *, detected: bool) -> HelipadFix | None:
        """Return the pad relative to the drone's present pose; None before the first detection."""
        pose = self._odometry.now
        if self._filter is None or pose is None:
            return None
        forward_m, right_m = pose.to_body(*(float(v) for v in self._filter.x.ravel()))
        return HelipadFix(
            captured_s=self._seen_s,
            forward_m=forward_m,
            right_m=right_m,
            detected=detected,
            confidence=self._confidence,
            std_m=float(np.sqrt(np.linalg.eigvalsh(self._filter.P)[-1])),
        )

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._filter = None
        self._seen_s = -math.inf
        self._rejected = 0

    def _start(self, measurement: np.ndarray, noise: np.ndarray) -> None:
        kalman = KalmanFilter(dim_x=2, dim_z=2)
        kalman.x = measurement.reshape(2, 1)
        kalman.F = np.eye(2)
        kalman.H = np.eye(2)
        kalman.P = noise.copy()
        self._filter = kalman

    def _distance(self, measurement: np.ndarray, noise: np.ndarray) -> float:
        residual = measurement - self._filter.x.ravel()  # type: ignore[union-attr]
        covariance = self._filter.P + noise  # type: ignore[union-attr]
        return float(residual @ np.linalg.solve(covariance, residual))

    def _measurement_noise(
        self, forward_m: float, right_m: float, yaw_rad: float, confidence: float
    ) -> np.ndarray:
        cfg = self._config
        range_m = math.hypot(forward_m, right_m)
        doubt = cfg.doubt_std_m * (1.0 - confidence)
        along = math.hypot(doubt, max(cfg.floor_std_m, cfg.range_std_ratio * range_m))
        across = math.hypot(doubt, max(cfg.floor_std_m, cfg.bearing_std_rad * range_m))
        direction = yaw_rad + math.atan2(right_m, forward_m)
        turn = rotation(direction)
        return np.asarray(turn @ np.diag([along**2, across**2]) @ turn.T)


class HelipadFinder:
    """Finds the helipad in class maps and tracks it through misses by dead reckoning.

    Args:
        mark: the size of the landing mark; default: the paper's.
    """

    def __init__(self, mark: LandingMark | None = None) -> None:
        self._mark = mark or LandingMark()
        self._detector, self._tracker = HelipadDetector(), HelipadTracker()
        self._reckons = False  # whether any telemetry has come
        self._seen: HelipadFix | None = None  # the detection in the newest class map
        self._accepted = False  # whether the track accepted that detection

    def predict(self, state: DroneState, now_s: float | None = None) -> None:
        """Integrate the drone's motion.

        Args:
            state: telemetry.
            now_s: time to which the newest pose is extrapolated, s; None for telemetry's newest
                time.
        """
        self._reckons = True
        self._tracker.predict(state, now_s)

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._tracker.forget()
        self.miss()

    def miss(self) -> None:
        """Record that no class map is available."""
        self._seen, self._accepted = None, False

    def see(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel
    ) -> HelipadDetection | None:
        """Search a class map and return the detection; mask noise gives None.

        Args:
            class_map: class map of `frame`.
            frame: its telemetry places the detection.
            camera: intrinsics at any size of the same aspect ratio.
        """
        self.miss()
        detection = self._detector.detect(class_map)
        if detection is None or not math.isfinite(
            frame.height_above_carpet_m + frame.gimbal_pitch_rad
        ):
            return detection
        height_px, width_px = class_map.ids.shape
        view = (
            camera.resized(width_px, height_px),
            frame.gimbal_pitch_rad,
            frame.height_above_carpet_m - self._mark.height_m,
        )
        place = locate(detection, *view)
        if place is None:
            return detection
        share = visible_share(detection, *view, self._mark)
        if share < _SPECK and math.hypot(*place) > _ABOVE_M:
            return None
        confidence = detection.score * share  # the centroid of a partial H is biased
        self._seen = HelipadFix(
            captured_s=frame.captured_s,
            forward_m=place[0],
            right_m=place[1],
            detected=True,
            confidence=confidence,
            height_m=self._mark.height_m,
        )
        self._accepted = self._tracker.update(
            *place, captured_s=frame.captured_s, confidence=confidence
        )
        return detection

    def fix(self) -> HelipadFix | None:
        """Return the helipad relative to the drone; without telemetry only while it is seen."""
        if not self._reckons:
            return self._seen
        fix = self._tracker.fix(detected=self._accepted)
        return None if fix is None else replace(fix, height_m=self._mark.height_m)
