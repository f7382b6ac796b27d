"""Kalman filter of the heading, from turns of the ground in the image and from telemetry.

Two images of the ground give a turn with an error below a milliradian. Over half a minute the sum
of such turns drifts less than telemetry. The filter's states are the heading and telemetry's error.
Without ground in view the heading follows telemetry. A jump of telemetry does not change the
heading.

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
        seen_rad: Of the sum of turns measured on the ground in one second.
        blind_rad: Of the turn between two frames without ground.
        reported_rad: Of the white noise of telemetry's heading.
        wander_rad: Of the change of telemetry's slow error in one second.
        leap_rad: Threshold, not a deviation: a larger innovation is a jump of telemetry, if the
            turn was measured on the ground.
    """

    seen_rad: float = 0.003
    blind_rad: float = 0.05
    reported_rad: float = 0.01
    wander_rad: float = 0.008
    leap_rad: float = 0.12


class Heading:
    """Estimates the heading frame by frame.

    Args:
        config: standard deviations of the two sources.
    """

    def __init__(self, config: HeadingConfig | None = None) -> None:
        self._config = config or HeadingConfig()
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
        """Update the filter with a frame.

        Args:
            reported_rad: telemetry's heading at its capture.
            turned_rad: turn since the previous frame, measured on the ground; None without ground.
            passed_s: time since the previous frame.
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
