"""The heading, from the turn of the ground in the image and from telemetry.

Two images of the ground show a turn to less than a milliradian. Their sum wanders less than
telemetry does in half a minute. A Kalman filter estimates the heading and telemetry's error of it.
Telemetry leads where no ground is seen; a leap of telemetry leaves the heading unchanged.

The filter is written here: it has two states and one measurement, so that a correction is four
lines; filterpy would need the same matrices, and it loads scipy.stats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

_REPORTED: Final = np.array([1.0, 1.0])  # telemetry measures the heading plus its error


@dataclass(frozen=True, kw_only=True)
class HeadingConfig:
    """Standard deviations of the two sources. All are chosen for the profiles `lab` and `harsh`.

    Attributes:
        seen_rad: of the turns that the ground shows, added up for a second.
        blind_rad: of the turn between two frames that show none.
        reported_rad: white noise of telemetry's heading.
        wander_rad: of telemetry's slow error, in a second.
        leap_rad: an innovation of more is a leap of telemetry, where the ground shows the turn.
    """

    seen_rad: float = 0.003
    blind_rad: float = 0.05
    reported_rad: float = 0.01
    wander_rad: float = 0.008
    leap_rad: float = 0.12


class Heading:
    """Estimates the heading frame by frame.

    Args:
        config: how the sensors err.
    """

    def __init__(self, config: HeadingConfig | None = None) -> None:
        self._config = config or HeadingConfig()
        self._mean_rad = np.zeros(2)  # the heading, and telemetry's error
        self._covariance = np.zeros((2, 2))
        self._reported_rad: float | None = None  # at the last frame

    @property
    def yaw_rad(self) -> float:
        """The heading at the last frame, clockwise; at the first it is telemetry's."""
        return float(self._mean_rad[0])

    @property
    def correction_rad(self) -> float:
        """To add to telemetry's heading."""
        return -float(self._mean_rad[1])

    def see(self, reported_rad: float, turned_rad: float | None, passed_s: float) -> None:
        """Take in a frame.

        Args:
            reported_rad: telemetry's heading at its capture.
            turned_rad: since the frame before, as the ground shows it; None where it does not.
            passed_s: since the frame before.
        """
        cfg, before_rad = self._config, self._reported_rad
        self._reported_rad = reported_rad
        if before_rad is None:
            self._mean_rad[0] = reported_rad
            self._covariance[0, 0] = cfg.reported_rad**2
            return
        if turned_rad is None:
            self._mean_rad[0] += math.remainder(reported_rad - before_rad, 2.0 * math.pi)
            self._covariance[0, 0] += cfg.blind_rad**2
        else:
            self._mean_rad[0] += turned_rad
            self._covariance[0, 0] += cfg.seen_rad**2 * passed_s
        self._covariance[1, 1] += cfg.wander_rad**2 * passed_s
        off_rad = math.remainder(reported_rad - float(self._mean_rad.sum()), 2.0 * math.pi)
        if turned_rad is not None and abs(off_rad) > cfg.leap_rad:
            self._mean_rad[1] += off_rad
            return
        spread = self._covariance @ _REPORTED
        gain = spread / (float(spread.sum()) + cfg.reported_rad**2)
        self._mean_rad = self._mean_rad + gain * off_rad
        self._covariance = self._covariance - np.outer(gain, spread)
