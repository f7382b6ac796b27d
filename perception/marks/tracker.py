"""Track of the landing mark over frames, including frames that do not show it.

The mark is fixed, so a Kalman filter with a constant state in a dead-reckoned frame is enough. The
odometry integrates the drone's velocity and yaw. Because video is late, sightings are placed by the
pose at their frame's capture. The fix is given relative to the present pose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter

from perception.marks.heading_track import HeadingTrack
from uav_bt.errors import ValueRangeError
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import DroneState, MarkFix, rotation
from uav_bt.types.dead_reckoning import Odometry, OdometryPose


@dataclass(frozen=True, kw_only=True)
class MarkTrackerConfig:
    """Noise model of the filter."""

    bearing_std_rad: float = 0.02  # about 3 pixels of a 224-wide class map
    range_std_ratio: float = 0.06  # error along the line of sight, relative to the range
    floor_std_m: float = 0.03  # error of the mark's middle at close range
    doubt_std_m: float = 0.3  # additional error, times 1 - confidence
    drift_std_mps: float = 0.05  # growth of dead reckoning's error, per square root of a second
    gate: float = 13.8  # squared Mahalanobis distance, chi-square 2 dof at 99.9 %
    rejections_to_restart: int = 5  # after this number of outliers in a row the track restarts


class MarkTracker:
    """Fuses sightings into one place of the mark, and one heading where sightings have it.

    Args:
        config: Noise model.
    """

    def __init__(self, config: MarkTrackerConfig | None = None) -> None:
        self._config = config or MarkTrackerConfig()
        self._odometry = Odometry()
        self._heading = HeadingTrack()
        self._filter: KalmanFilter | None = None
        self._filter_time_s = 0.0
        self._seen_s = -math.inf
        self._confidence = self._height_m = 0.0  # of the last sighting
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
            self._heading.predict(dt)
        self._filter_time_s = pose.time_s

    def pose_at(self, time_s: float) -> OdometryPose | None:
        """Return the drone's pose at a time in the last seconds; None before any telemetry."""
        return self._odometry.at(time_s)

    def update(self, sighting: MarkSighting, *, captured_s: float) -> bool:
        """Update the track with a sighting; a less confident one moves it less.

        Args:
            sighting: The mark, relative to the pose at the frame's capture.
            captured_s: Capture time of the frame.

        Returns:
            False if the sighting was rejected as an outlier or came before any telemetry.

        Raises:
            ValueRangeError: The capture time is not finite.
        """
        if not math.isfinite(captured_s):
            raise ValueRangeError(
                f"the capture time of a sighting must be finite, got {captured_s}"
            )
        pose = self._odometry.at(captured_s)
        if pose is None:
            return False
        measurement = np.array(pose.to_world(sighting.forward_m, sighting.right_m))
        noise = self._measurement_noise(sighting, pose.yaw_rad)
        if self._filter is None or self._rejected >= self._config.rejections_to_restart:
            self._start(measurement, noise)
            self._heading.forget()
        elif self._distance(measurement, noise) > self._config.gate:
            self._rejected += 1
            return False
        else:
            self._filter.update(measurement, R=noise)
        if sighting.heading_deg is not None:
            up_rad = pose.yaw_rad - math.radians(sighting.heading_deg)
            self._heading.update(up_rad, confidence=sighting.confidence)
        self._rejected = 0
        self._seen_s = max(self._seen_s, captured_s)
        self._confidence, self._height_m = sighting.confidence, sighting.height_m
        return True

    def fix(self, *, detected: bool) -> MarkFix | None:
        """Return the mark relative to the drone's present pose; None before the first sighting."""
        pose = self._odometry.now
        if self._filter is None or pose is None:
            return None
        forward_m, right_m = pose.to_body(*(float(v) for v in self._filter.x.ravel()))
        return MarkFix(
            captured_s=self._seen_s,
            forward_m=forward_m,
            right_m=right_m,
            height_m=self._height_m,
            detected=detected,
            confidence=self._confidence,
            std_m=float(np.sqrt(np.linalg.eigvalsh(self._filter.P)[-1])),
            heading_deg=self._heading.relative_deg(pose.yaw_rad),
        )

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._filter = None
        self._heading.forget()
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

    def _measurement_noise(self, sighting: MarkSighting, yaw_rad: float) -> np.ndarray:
        cfg, range_m = self._config, sighting.range_m
        doubt = cfg.doubt_std_m * (1.0 - sighting.confidence)
        along = math.hypot(doubt, max(cfg.floor_std_m, cfg.range_std_ratio * range_m))
        across = math.hypot(doubt, max(cfg.floor_std_m, cfg.bearing_std_rad * range_m))
        direction = yaw_rad + math.atan2(sighting.right_m, sighting.forward_m)
        turn = rotation(direction)
        return np.asarray(turn @ np.diag([along**2, across**2]) @ turn.T)
