"""Track the helipad from class map to class map, also through frames that miss it.

The pad stands still, so a Kalman filter with a constant state in a dead-reckoned frame does it: the
odometry integrates the drone's own velocity and yaw, detections are placed at the pose their frame
was captured at (video is late), and the fix is read relative to the pose of now.
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

# Of a whole H: a smaller one is a mask's error, for which boxes show up to 0.02. Only from just
# above the pad so little of its H is in view.
_SPECK: Final = 0.1
_ABOVE_M: Final = 0.5


@dataclass(frozen=True, kw_only=True)
class HelipadTrackerConfig:
    """Noise model of the filter."""

    bearing_std_rad: float = 0.02  # about 3 pixels of a 224-wide class map
    range_std_ratio: float = 0.06  # of the range: a pixel of elevation weighs more far away
    floor_std_m: float = 0.03  # close up, the centroid of the H is this good
    doubt_std_m: float = 0.3  # of a detection with confidence 0; in proportion in between
    drift_std_mps: float = 0.05  # dead reckoning's error growth while the pad is unseen
    gate: float = 13.8  # squared Mahalanobis distance, chi-square 2 dof at 99.9 %
    rejections_to_restart: int = 5  # so many outliers in a row mean that the track is wrong


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
        """Follow the drone's own motion.

        Args:
            state: telemetry.
            now_s: until when the newest pose is carried on, s; None for telemetry's newest time.
        """
        pose = self._odometry.update(state, now_s)
        if self._filter is not None:
            dt = max(0.0, pose.time_s - self._filter_time_s)
            self._filter.predict(Q=np.eye(2) * (self._config.drift_std_mps**2 * dt))
        self._filter_time_s = pose.time_s

    def update(
        self, forward_m: float, right_m: float, *, captured_s: float, confidence: float
    ) -> bool:
        """Take in a detection.

        Args:
            forward_m: ahead of the body's centre when the frame was captured, level.
            right_m: to its right.
            captured_s: when that was.
            confidence: 0 to 1; the less, the less the detection moves the track.

        Returns:
            False when the detection was rejected as an outlier (or came before any telemetry).

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
        """Return the pad relative to the drone now, None before the first detection."""
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
    """Finds the helipad in class maps and carries it through misses by dead reckoning.

    Args:
        mark: the size of the landing mark; default: the paper's.
    """

    def __init__(self, mark: LandingMark | None = None) -> None:
        self._mark = mark or LandingMark()
        self._detector, self._tracker = HelipadDetector(), HelipadTracker()
        self._reckons = False  # whether there was any telemetry to carry it by
        self._seen: HelipadFix | None = None  # in the newest class map
        self._accepted = False  # whether the track took that in

    def predict(self, state: DroneState, now_s: float | None = None) -> None:
        """Follow the drone's own motion.

        Args:
            state: telemetry.
            now_s: until when the newest pose is carried on, s; None for telemetry's newest time.
        """
        self._reckons = True
        self._tracker.predict(state, now_s)

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._tracker.forget()
        self.miss()

    def miss(self) -> None:
        """Note that there is no class map to look at."""
        self._seen, self._accepted = None, False

    def see(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel
    ) -> HelipadDetection | None:
        """Take in a class map and return what was detected in it; specks are nothing.

        Args:
            class_map: made from `frame`.
            frame: its telemetry places what is seen.
            camera: intrinsics at any size of the same aspect.
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
        confidence = detection.score * share  # the middle of a part is not that of the whole
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
        """Return where the helipad is from the drone now; without telemetry only while seen."""
        if not self._reckons:
            return self._seen
        fix = self._tracker.fix(detected=self._accepted)
        return None if fix is None else replace(fix, height_m=self._mark.height_m)
