"""Filters of telemetry's errors: heading, horizontal velocity, and the scale of displacements.

They are written here: each has two states or sums and one measurement, in complex numbers where
both axes share one variance. filterpy would need the same matrices, and it loads scipy.stats.
Numbers without another origin are chosen, for the profiles `lab` and `harsh`.
"""

from __future__ import annotations

import cmath
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Floats

# The heading: standard deviations, rad.
_SEEN_RAD: Final = 0.003  # of the sum of turns measured on the ground in one second
_BLIND_RAD: Final = 0.05  # of the turn between two frames without ground
_REPORTED_RAD: Final = 0.01  # of the white noise of telemetry's heading
_WANDER_RAD: Final = 0.008  # of the change of telemetry's slow error in one second
_LEAP_RAD: Final = 0.12  # a larger innovation is a jump of telemetry, if the ground showed the turn
_REPORTED: Final = np.array([1.0, 1.0])  # telemetry measures the heading plus its error

# The error of the velocity.
_WANDER_MPS: Final = 0.015  # standard deviation of its change in one second
_FIRST_MPS: Final = 0.05  # likewise at first; wide, so that the first turn separates the two parts
_FORGET_S: Final = 30.0  # time constant of its decay without measurements
_DOUBT_MPS: Final = 0.012  # an error up to this size counts as zero
_SEEN_M: Final = 0.003  # standard deviation of a displacement, for points with this spread:
_WIDE_M: Final = 0.6  # root mean square; it grows with the inverse square of the spread
# Squared innovation over its variance above which a measurement is an outlier: a wall that is taken
# for ground moves unlike the ground. After this number of outliers in a row the next is believed.
_GATE: Final = 25.0
_OUTLIERS: Final = 8

# The stretch.
_STRETCH_FORGET_S: Final = 20.0  # time constant with which displacements are forgotten
# Largest standard error of a factor that is returned. The errors of successive displacements are
# alike, and the true error is about twice as large.
_STRETCH_ERROR: Final = 0.04
_VARIED_MPS: Final = 0.08  # least deviation of the reported velocities: hovering shows no factor
_LEAST: Final = 1e-9


class Heading:
    """Kalman filter of the heading and of telemetry's error of it, frame by frame.

    Two images of the ground give a turn with an error below a milliradian; their sum drifts less
    than telemetry. Without ground in view the heading follows telemetry, but not its jumps.
    """

    def __init__(self) -> None:
        self._mean_rad = np.zeros(2)  # the heading, and telemetry's error
        self._covariance = np.zeros((2, 2))
        self._reported_rad: float | None = None  # telemetry's heading at the last frame

    @property
    def yaw_rad(self) -> float:
        """The heading at the last frame, clockwise; at the first frame telemetry's."""
        return float(self._mean_rad[0])

    @property
    def correction_rad(self) -> float:
        """Correction to add to telemetry's heading."""
        return -float(self._mean_rad[1])

    def see(self, reported_rad: float, turned_rad: float | None, passed_s: float) -> None:
        """Update with telemetry's heading at a frame, and the turn since the last by the ground."""
        before_rad, self._reported_rad = self._reported_rad, reported_rad
        if before_rad is None:
            self._mean_rad[0] = reported_rad
            self._covariance[0, 0] = _REPORTED_RAD**2
            return
        if turned_rad is None:
            self._mean_rad[0] += math.remainder(reported_rad - before_rad, 2.0 * math.pi)
            self._covariance[0, 0] += _BLIND_RAD**2
        else:
            self._mean_rad[0] += turned_rad
            self._covariance[0, 0] += _SEEN_RAD**2 * passed_s
        self._covariance[1, 1] += _WANDER_RAD**2 * passed_s
        off_rad = math.remainder(reported_rad - float(self._mean_rad.sum()), 2.0 * math.pi)
        if turned_rad is not None and abs(off_rad) > _LEAP_RAD:
            self._mean_rad[1] += off_rad
            return
        spread = self._covariance @ _REPORTED
        gain = spread / (float(spread.sum()) + _REPORTED_RAD**2)
        self._mean_rad = self._mean_rad + gain * off_rad
        self._covariance = self._covariance - np.outer(gain, spread)


class VelocityError:
    """Kalman filter of the error of telemetry's velocity, measured over the ground.

    A drift that telemetry misses keeps its direction in the world. A bias of the drone's estimate
    turns with the drone. Only a turn separates them: until then half of the error counts as each. A
    drone that turns away from the ground flies by them. Headings are of the odometry's frame.
    """

    def __init__(self) -> None:
        # Drift in the odometry's frame and bias in the body frame, m/s: x or forward, y or right.
        self._mean = np.zeros(2, dtype=np.complex128)
        self._covariance = np.eye(2, dtype=np.complex128) * _FIRST_MPS**2 / 2
        self._rejected = 0  # in a row

    def mps(self, yaw_rad: float) -> Floats:
        """Return the error in the odometry's frame, (2,), shrunk by its uncertainty."""
        error = self._believed(yaw_rad) @ _seen_at(yaw_rad)
        return np.array([error.real, error.imag])

    def bias_mps(self, yaw_rad: float) -> Floats:
        """Return the part of `mps` that turns with the drone, (2,) forward and right."""
        bias = self._believed(yaw_rad)[1]
        return np.array([bias.real, bias.imag])

    def _believed(self, yaw_rad: float) -> NDArray[np.complex128]:
        size_mps = max(float(abs(self._mean @ _seen_at(yaw_rad))), _DOUBT_MPS)
        return self._mean * (1.0 - (_DOUBT_MPS / size_mps) ** 2)

    def predict(self, passed_s: float) -> None:
        """Predict the error after a time."""
        self._mean *= math.exp(-passed_s / _FORGET_S)
        self._covariance += np.eye(2) * _WANDER_MPS**2 * passed_s / 2

    def correct(self, seen_mps: Floats, passed_s: float, spread_m: float, yaw_rad: float) -> None:
        """Correct the error by the motion between two frames; an outlier is left out.

        `seen_mps` is the velocity beyond telemetry's, (2,), in the odometry's frame; `spread_m`
        the root mean square of the tracked points around their middle.
        """
        seen = _seen_at(yaw_rad)
        closer = max(1.0, _WIDE_M / spread_m) ** 2
        noise = (_SEEN_M * closer / passed_s) ** 2
        spread = self._covariance @ seen.conj()
        variance, innovation = (seen @ spread).real + noise, complex(*seen_mps) - self._mean @ seen
        if abs(innovation) ** 2 > _GATE * variance and self._rejected < _OUTLIERS:
            self._rejected += 1
            return
        self._rejected = 0
        gain = spread / variance
        self._mean += gain * innovation
        self._covariance -= np.outer(gain, spread.conj())


def _seen_at(yaw_rad: float) -> NDArray[np.complex128]:
    """Return the factors of drift and bias in a measured error, (2,)."""
    return np.array([1.0, cmath.exp(1j * yaw_rad)])


class Stretch:
    """Factor between the displacements that frames show and those that telemetry reports.

    If height or focal length is wrong by a factor, so are all displacements. A drift or a bias of
    telemetry's velocity adds the same to all of them. A regression of the seen on the reported
    velocities, about their means, separates the two: the slope is the factor.
    """

    def __init__(self) -> None:
        self._steps = 0.0  # weighted number of displacements
        self._seen = self._reported = self._product = 0j  # weighted sums
        self._seen2 = self._reported2 = 0.0

    def add(self, seen_mps: complex, reported_mps: complex, passed_s: float) -> None:
        """Add the mean velocities between two frames, forward + right j in the body frame."""
        keeps = math.exp(-passed_s / _STRETCH_FORGET_S)
        self._steps = keeps * self._steps + 1.0
        self._seen = keeps * self._seen + seen_mps
        self._reported = keeps * self._reported + reported_mps
        self._product = keeps * self._product + reported_mps.conjugate() * seen_mps
        self._seen2 = keeps * self._seen2 + abs(seen_mps) ** 2
        self._reported2 = keeps * self._reported2 + abs(reported_mps) ** 2

    @property
    def factor(self) -> float | None:
        """Seen over reported displacement; None while it is not known well enough."""
        steps = max(self._steps, 1.0)
        varied = self._reported2 - abs(self._reported) ** 2 / steps
        if steps < 2.0 or varied < steps * _VARIED_MPS**2:
            return None
        shared = (self._product - self._reported.conjugate() * self._seen / steps).real
        rest = self._seen2 - abs(self._seen) ** 2 / steps - shared**2 / varied
        if math.sqrt(max(rest, _LEAST) / steps / varied) > _STRETCH_ERROR:
            return None
        return shared / varied
