"""The error of telemetry's velocity against the motion over the ground.

The Kalman filter is written here: one variance serves both axes, so each step is scalar and three
lines long; filterpy would need matrices, and it loads scipy.stats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class VelocityErrorConfig:
    """How the error varies, and how well two frames show it. All numbers are chosen.

    Attributes:
        wander_mps: standard deviation of the error's change in one second, m/s.
        first_mps: standard deviation of the error at first, m/s.
        forget_s: time constant with which an unseen error decays, s.
        doubt_mps: an error up to this size counts as none, m/s.
        seen_m: standard deviation of the way between two frames, m, when the points of the ground
            spread by `wide_m`. It grows with the inverse square of the spread.
        wide_m: that spread, root mean square around the points' middle, m.
    """

    wander_mps: float = 0.015
    first_mps: float = 0.03
    forget_s: float = 30.0
    doubt_mps: float = 0.012
    seen_m: float = 0.003
    wide_m: float = 0.6


class VelocityError:
    """Estimates a slowly wandering error of the velocity: a Kalman filter, the same in both axes.

    Args:
        config: how the error varies.
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
            spread_m: of the points that show it, root mean square around their middle.
        """
        cfg = self._config
        closer = max(1.0, cfg.wide_m / spread_m) ** 2
        noise = (cfg.seen_m * closer / passed_s) ** 2
        gain = self._variance / (self._variance + noise)
        self._mean_mps = self._mean_mps + gain * (seen_mps - self._mean_mps)
        self._variance *= 1.0 - gain
