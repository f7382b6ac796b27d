"""Kalman filter of the error of telemetry's velocity, measured over the ground.

The filter is written here: both axes share one variance, so each step is scalar and three lines
long; filterpy would need matrices, and it loads scipy.stats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class VelocityErrorConfig:
    """Noise model of the filter. All numbers are chosen.

    Attributes:
        wander_mps: Standard deviation of the error's change in one second, m/s.
        first_mps: Standard deviation of the initial error, m/s.
        forget_s: Time constant of the decay of the error without measurements, s.
        doubt_mps: An error up to this size counts as zero, m/s.
        seen_m: Standard deviation of the displacement between two frames, m, for points with a
            spread of `wide_m`. It grows with the inverse square of the spread.
        wide_m: Spread of the points for `seen_m`, root mean square around their middle, m.
    """

    wander_mps: float = 0.015
    first_mps: float = 0.03
    forget_s: float = 30.0
    doubt_mps: float = 0.012
    seen_m: float = 0.003
    wide_m: float = 0.6


class VelocityError:
    """Kalman filter of a slowly varying velocity error, with the same variance in both axes.

    Args:
        config: noise model.
    """

    def __init__(self, config: VelocityErrorConfig | None = None) -> None:
        self._config = config or VelocityErrorConfig()
        self._variance = self._config.first_mps**2
        self._mean_mps: NDArray[np.float64] = np.zeros(2)

    @property
    def mps(self) -> NDArray[np.float64]:
        """The error in the odometry's frame, (2,), shrunk towards zero by its uncertainty."""
        size_mps = max(float(np.hypot(*self._mean_mps)), self._config.doubt_mps)
        return self._mean_mps * (1.0 - (self._config.doubt_mps / size_mps) ** 2)

    def predict(self, passed_s: float) -> None:
        """Predict the error after a time, s."""
        self._mean_mps = self._mean_mps * math.exp(-passed_s / self._config.forget_s)
        self._variance += self._config.wander_mps**2 * passed_s

    def correct(self, seen_mps: NDArray[np.float64], passed_s: float, spread_m: float) -> None:
        """Correct the error by the motion between two frames.

        Args:
            seen_mps: velocity beyond telemetry's, (2,), in the odometry's frame.
            passed_s: time between the two frames.
            spread_m: spread of the tracked points, root mean square around their middle.
        """
        cfg = self._config
        closer = max(1.0, cfg.wide_m / spread_m) ** 2
        noise = (cfg.seen_m * closer / passed_s) ** 2
        gain = self._variance / (self._variance + noise)
        self._mean_mps = self._mean_mps + gain * (seen_mps - self._mean_mps)
        self._variance *= 1.0 - gain
