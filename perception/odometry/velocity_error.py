"""Kalman filter of the error of telemetry's velocity, measured over the ground.

The error has two parts. A drift that telemetry misses keeps its direction in the world. A bias of
the drone's estimate turns with the drone. Only a turn separates them: until then half of the error
counts as each. A drone that turns away from the ground needs the parts, because it then flies by
the last estimate.

The filter is written here: both axes share one variance, so a horizontal vector is one complex
number, and the filter has two states and one measurement.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class VelocityErrorConfig:
    """Noise model of the filter. All numbers are chosen.

    Attributes:
        wander_mps: Standard deviation of the error's change in one second, m/s.
        first_mps: Standard deviation of the initial error, m/s. Wide, so that the first turn
            separates the two parts of a large error.
        forget_s: Time constant of the decay of the error without measurements, s.
        doubt_mps: An error up to this size counts as zero, m/s.
        seen_m: Standard deviation of the displacement between two frames, m, for points with a
            spread of `wide_m`. It grows with the inverse square of the spread.
        wide_m: Spread of the points for `seen_m`, root mean square around their middle, m.
        gate: Squared innovation over its variance above which a measurement is an outlier. A wall
            that is taken for ground moves unlike the ground.
        outliers: After this number of outliers in a row the next one is believed.
    """

    wander_mps: float = 0.015
    first_mps: float = 0.05
    forget_s: float = 30.0
    doubt_mps: float = 0.012
    seen_m: float = 0.003
    wide_m: float = 0.6
    gate: float = 25.0
    outliers: int = 8


class VelocityError:
    """Kalman filter of a slowly varying velocity error.

    Args:
        config: noise model.
    """

    def __init__(self, config: VelocityErrorConfig | None = None) -> None:
        self._config = config or VelocityErrorConfig()
        # Drift in the odometry's frame and bias in the body frame, m/s: x or forward, y or right.
        self._mean = np.zeros(2, dtype=np.complex128)
        self._covariance = np.eye(2, dtype=np.complex128) * self._config.first_mps**2 / 2
        self._rejected = 0  # in a row

    def mps(self, yaw_rad: float) -> NDArray[np.float64]:
        """Return the error in the odometry's frame, (2,), m/s, shrunk by its uncertainty.

        Args:
            yaw_rad: heading in the odometry's frame, clockwise positive.
        """
        return _xy(complex(self._believed(yaw_rad) @ _seen_at(yaw_rad)))

    def bias_mps(self, yaw_rad: float) -> NDArray[np.float64]:
        """Return the part of `mps` that turns with the drone, (2,) forward and right, m/s.

        Args:
            yaw_rad: heading in the odometry's frame, clockwise positive.
        """
        return _xy(complex(self._believed(yaw_rad)[1]))

    def _believed(self, yaw_rad: float) -> NDArray[np.complex128]:
        doubt_mps = self._config.doubt_mps
        size_mps = max(float(abs(self._mean @ _seen_at(yaw_rad))), doubt_mps)
        return self._mean * (1.0 - (doubt_mps / size_mps) ** 2)

    def predict(self, passed_s: float) -> None:
        """Predict the error after a time, s."""
        self._mean *= math.exp(-passed_s / self._config.forget_s)
        self._covariance += np.eye(2) * self._config.wander_mps**2 * passed_s / 2

    def correct(
        self, seen_mps: NDArray[np.float64], passed_s: float, spread_m: float, yaw_rad: float
    ) -> None:
        """Correct the error by the motion between two frames; an outlier is left out.

        Args:
            seen_mps: velocity beyond telemetry's, (2,), in the odometry's frame.
            passed_s: time between the two frames.
            spread_m: spread of the tracked points, root mean square around their middle.
            yaw_rad: heading between the two frames, in the odometry's frame, clockwise positive.
        """
        cfg, seen = self._config, _seen_at(yaw_rad)
        closer = max(1.0, cfg.wide_m / spread_m) ** 2
        noise = (cfg.seen_m * closer / passed_s) ** 2
        spread = self._covariance @ seen.conj()
        variance, innovation = (seen @ spread).real + noise, complex(*seen_mps) - self._mean @ seen
        if abs(innovation) ** 2 > cfg.gate * variance and self._rejected < cfg.outliers:
            self._rejected += 1
            return
        self._rejected = 0
        gain = spread / variance
        self._mean += gain * innovation
        self._covariance -= np.outer(gain, spread.conj())


def _seen_at(yaw_rad: float) -> NDArray[np.complex128]:
    """Return the factors of drift and bias in a measured error, (2,)."""
    return np.array([1.0, cmath.exp(1j * yaw_rad)])


def _xy(value: complex) -> NDArray[np.float64]:
    return np.array([value.real, value.imag])
