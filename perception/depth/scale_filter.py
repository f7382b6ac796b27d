"""Smooths a scale over time and turns outliers away.

The logarithm of the scale is what varies evenly (a network that sees everything a tenth too near
does so near and far), so a Kalman filter with one slowly wandering state runs on that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class ScaleFilterConfig:
    """Noise model, in parts of the scale (0.01 is one percent)."""

    wander_std: float = 0.05  # of a second: the network's unit changes with what it looks at
    floor_std: float = 0.01  # of a measurement: height and pitch are wrong for all points alike
    gate: float = 10.8  # squared innovation over its variance: chi-square, 1 dof, 99.9 %
    rejections_to_restart: int = 5  # so many outliers in a row mean that the state is wrong
    lost_std: float = 0.15  # more uncertain than this is no scale: a metre would be a hand wrong

    def __post_init__(self) -> None:
        stds = (self.wander_std, self.floor_std, self.gate, self.lost_std)
        if not all(math.isfinite(value) and value > 0.0 for value in stds):
            raise ValueRangeError(
                f"the scale filter needs positive standard deviations, got {self}"
            )


class ScaleFilter:
    """A Kalman filter over the logarithm of the scale."""

    def __init__(self, config: ScaleFilterConfig | None = None) -> None:
        self._config = config or ScaleFilterConfig()
        self._filter: KalmanFilter | None = None
        self._time_s = -math.inf
        self._rejected = 0

    def update(self, log_scale: float, std: float, captured_s: float) -> bool:
        """Take in a measurement.

        Args:
            log_scale: natural logarithm of the measured scale.
            std: its standard deviation from the scatter of its points.
            captured_s: when; an older one than the newest does not turn time back.

        Returns:
            False when it was turned away as an outlier.

        Raises:
            ValueRangeError: a number is not finite.
        """
        if not all(map(math.isfinite, (log_scale, std, captured_s))):
            raise ValueRangeError(
                f"a scale must be finite, got log {log_scale} +- {std} at {captured_s} s"
            )
        noise = std**2 + self._config.floor_std**2
        self._predict(captured_s)
        if self._filter is None or self._rejected >= self._config.rejections_to_restart:
            self._start(log_scale, noise, captured_s)
        elif _surprise(self._filter, log_scale, noise) > self._config.gate:
            self._rejected += 1
            return False
        else:
            self._filter.update(np.array([[log_scale]]), R=noise)
        self._rejected = 0
        return True

    def at(self, time_s: float) -> tuple[float, float] | None:
        """Return the logarithm of the scale and how certain it is, 1 to 0.

        Returns:
            None before the first measurement, and when the last one is too long ago.
        """
        self._predict(time_s)
        if self._filter is None:
            return None
        std = math.sqrt(self._filter.P[0, 0])
        if std > self._config.lost_std:
            return None
        return float(self._filter.x[0, 0]), 1.0 - std / self._config.lost_std

    def _predict(self, time_s: float) -> None:
        if self._filter is not None and time_s > self._time_s:
            self._filter.predict(Q=self._config.wander_std**2 * (time_s - self._time_s))
            self._time_s = time_s

    def _start(self, log_scale: float, noise: float, time_s: float) -> None:
        kalman = KalmanFilter(dim_x=1, dim_z=1)
        kalman.x = np.array([[log_scale]])
        kalman.P = np.array([[noise]])
        kalman.H = kalman.F = np.eye(1)
        self._filter, self._time_s = kalman, time_s


def _surprise(kalman: KalmanFilter, log_scale: float, noise: float) -> float:
    innovation = log_scale - float(kalman.x[0, 0])
    return innovation**2 / (float(kalman.P[0, 0]) + noise)
