"""Track of the landing mark over frames, including frames that do not show it.

The mark is fixed, so a Kalman filter with a constant state in a dead-reckoned frame is enough. The
odometry integrates the drone's velocity and yaw. Because video is late, sightings are placed by the
pose at their frame's capture. The fix is given relative to the present pose.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Final

import numpy as np
from filterpy.kalman import KalmanFilter

from uav_bt.landing_marks import MarkSighting
from uav_bt.types import DroneState, MarkFix, rotation
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import Odometry, OdometryPose

_BEARING_RAD: Final = 0.02  # standard deviation: about 3 pixels of a 224-wide class map
_RANGE_SHARE: Final = 0.06  # standard deviation along the line of sight, relative to the range
_FLOOR_M: Final = 0.03  # standard deviation of the mark's middle at close range
_DOUBT_M: Final = 0.3  # additional standard deviation, times 1 - confidence
_DRIFT_MPS: Final = 0.05  # growth of dead reckoning's error, per square root of a second
_GATE: Final = 13.8  # squared Mahalanobis distance, chi-square with 2 degrees of freedom at 99.9 %
_RESTART: Final = 5  # after this number of outliers in a row the track restarts
# The same of the heading. Tags at 3 m: `benchmarks/landing_marks.py`; the others are chosen.
_HEADING_RAD: Final = math.radians(3.0)
_HEADING_DOUBT_RAD: Final = math.radians(20.0)
_HEADING_DRIFT_RADPS: Final = math.radians(0.5)
_HEADING_GATE: Final = 3.5  # standard deviations


class MarkTracker:
    """Fuses the sightings of any finder into one place, and one heading where they have it."""

    def __init__(self) -> None:
        self._odometry = Odometry()
        self._filter_time_s = 0.0
        self.forget()

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._filter: KalmanFilter | None = None
        self._seen: MarkFix | None = None  # the sighting in the newest frame
        self._accepted = False  # whether the track accepted that sighting
        self._last: MarkFix | None = None  # the last sighting used, with the newest capture time
        # Direction of the mark's upper edge in the odometry's frame, rad, and its variance
        self._up: tuple[float, float] | None = None
        self._rejected = self._up_rejected = 0  # outliers in a row

    def predict(self, state: DroneState, now_s: float | None = None) -> None:
        """Integrate the drone's motion up to `now_s`; None for telemetry's newest time."""
        pose = self._odometry.update(state, now_s)
        if self._filter is not None:
            dt = max(0.0, pose.time_s - self._filter_time_s)
            self._filter.predict(Q=np.eye(2) * (_DRIFT_MPS**2 * dt))
            if self._up is not None:
                self._up = self._up[0], self._up[1] + _HEADING_DRIFT_RADPS**2 * dt
        self._filter_time_s = pose.time_s

    def pose_at(self, time_s: float) -> OdometryPose | None:
        """Return the dead-reckoned pose at a time in the last seconds; None before telemetry."""
        return self._odometry.at(time_s)

    def see(self, sighting: MarkSighting | None, captured_s: float) -> None:
        """Update the track with the newest frame; None if the frame does not show the mark."""
        self._seen, self._accepted = None, False
        if sighting is None:
            return
        self._seen = MarkFix(captured_s=captured_s, detected=True, **asdict(sighting))
        pose = self._odometry.at(captured_s)
        self._accepted = pose is not None and self._place(self._seen, pose)
        if pose is not None and self._accepted:
            if sighting.heading_deg is not None:
                self._turn(pose.yaw_rad - math.radians(sighting.heading_deg), sighting.confidence)
            newest_s = captured_s if self._last is None else max(self._last.captured_s, captured_s)
            self._last = replace(self._seen, captured_s=newest_s)

    def fix(self) -> MarkFix | None:
        """Return the mark relative to the drone; without telemetry only while it is seen."""
        pose = self._odometry.now
        if pose is None:
            return self._seen
        if self._filter is None or self._last is None:
            return None
        forward_m, right_m = pose.to_body(*(float(v) for v in self._filter.x.ravel()))
        heading_deg = None
        if self._up is not None:
            heading_deg = math.degrees(math.remainder(pose.yaw_rad - self._up[0], math.tau))
        return replace(
            self._last,
            forward_m=forward_m,
            right_m=right_m,
            detected=self._accepted,
            std_m=float(np.sqrt(np.linalg.eigvalsh(self._filter.P)[-1])),
            heading_deg=heading_deg,
        )

    def _place(self, seen: MarkFix, pose: OdometryPose) -> bool:
        """Move the track by a sighting from a pose; return False for an outlier."""
        measured = np.array(pose.to_world(seen.forward_m, seen.right_m))
        noise = _noise(seen, pose.yaw_rad)
        if self._filter is None or self._rejected >= _RESTART:
            self._filter = KalmanFilter(dim_x=2, dim_z=2)
            self._filter.x = measured.reshape(2, 1)
            self._filter.F = np.eye(2)
            self._filter.H = np.eye(2)
            self._filter.P = noise.copy()
            self._up, self._up_rejected = None, 0
        else:
            off = measured - self._filter.x.ravel()
            if float(off @ np.linalg.solve(self._filter.P + noise, off)) > _GATE:
                self._rejected += 1
                return False
            self._filter.update(measured, R=noise)
        self._rejected = 0
        return True

    def _turn(self, up_rad: float, confidence: float) -> None:
        """Move the heading by a measured direction of the upper edge; outliers count alone."""
        noise = _HEADING_RAD**2 + (_HEADING_DOUBT_RAD * (1.0 - confidence)) ** 2
        if self._up is None or self._up_rejected >= _RESTART:
            self._up, self._up_rejected = (up_rad, noise), 0
            return
        old_rad, variance = self._up
        off_rad = math.remainder(up_rad - old_rad, math.tau)
        if abs(off_rad) > _HEADING_GATE * math.sqrt(variance + noise):
            self._up_rejected += 1
            return
        gain = variance / (variance + noise)
        self._up, self._up_rejected = (old_rad + gain * off_rad, variance * (1.0 - gain)), 0


def _noise(seen: MarkFix, yaw_rad: float) -> Floats:
    """Return the covariance of a sighting in the odometry's frame, (2, 2)."""
    doubt_m, range_m = _DOUBT_M * (1.0 - seen.confidence), seen.range_m
    along_m = math.hypot(doubt_m, max(_FLOOR_M, _RANGE_SHARE * range_m))
    across_m = math.hypot(doubt_m, max(_FLOOR_M, _BEARING_RAD * range_m))
    turn = rotation(yaw_rad + seen.bearing_rad)
    return np.asarray(turn @ np.diag([along_m**2, across_m**2]) @ turn.T)
