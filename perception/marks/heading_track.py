"""Direction of the landing mark's upper edge, filtered in the dead-reckoned frame."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class HeadingTrackConfig:
    """Noise model of the filter.

    Attributes:
        std_rad: Standard deviation of a confident measurement. Tags at 3 m:
            `benchmarks/landing_marks.py`.
        doubt_std_rad: In addition, times 1 - confidence. Chosen.
        drift_std_radps: Growth of dead reckoning's error, per square root of a second. Chosen.
        gate: Deviation in standard deviations above which a measurement is an outlier. Chosen.
        rejections_to_restart: Number of outliers in a row that restarts the filter. Chosen.
    """

    std_rad: float = math.radians(3.0)
    doubt_std_rad: float = math.radians(20.0)
    drift_std_radps: float = math.radians(0.5)
    gate: float = 3.5
    rejections_to_restart: int = 5


class HeadingTrack:
    """Scalar Kalman filter of an angle.

    Args:
        config: Noise model.
    """

    def __init__(self, config: HeadingTrackConfig | None = None) -> None:
        self._config = config or HeadingTrackConfig()
        self.forget()

    def forget(self) -> None:
        """Drop the direction."""
        self._up_rad: float | None = None
        self._variance = math.inf
        self._rejected = 0

    def predict(self, duration_s: float) -> None:
        """Let the error grow with time."""
        self._variance += self._config.drift_std_radps**2 * duration_s

    def update(self, up_rad: float, *, confidence: float) -> None:
        """Add a measurement.

        Args:
            up_rad: Direction of the upper edge in the dead-reckoned frame, clockwise.
            confidence: 0 to 1.
        """
        cfg = self._config
        noise = cfg.std_rad**2 + (cfg.doubt_std_rad * (1.0 - confidence)) ** 2
        if self._up_rad is None or self._rejected >= cfg.rejections_to_restart:
            self._up_rad, self._variance, self._rejected = up_rad, noise, 0
            return
        off_rad = math.remainder(up_rad - self._up_rad, math.tau)
        if abs(off_rad) > cfg.gate * math.sqrt(self._variance + noise):
            self._rejected += 1
            return
        gain = self._variance / (self._variance + noise)
        self._up_rad += gain * off_rad
        self._variance *= 1.0 - gain
        self._rejected = 0

    def relative_deg(self, yaw_rad: float) -> float | None:
        """Return the heading of a drone relative to the mark, -180 to 180; None if unknown.

        Args:
            yaw_rad: Yaw of the drone in the dead-reckoned frame, clockwise.
        """
        if self._up_rad is None:
            return None
        return math.degrees(math.remainder(yaw_rad - self._up_rad, math.tau))
