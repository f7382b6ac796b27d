"""How high the drone is above the carpet, by its altimeter and by what it measures downwards.

An altimeter wanders by centimetres with pressure and air flow, and all that the camera places on
the ground is wrong by the same share of its range. The rangefinder has no such error, but measures
to the box or the landing pad that it is above. A Kalman filter estimates the height and the
altimeter's error, and between two measurements it follows the vertical velocity. What stands lower
than some 0.3 m above the carpet cannot be distinguished from it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types import DroneState, Frame, Observation

_ALTIMETER: Final = np.array([1.0, 1.0])  # of the states, height and error, what each measures
_RANGEFINDER: Final = np.array([1.0, 0.0])
_SAME_M: Final = 1e-6


@dataclass(frozen=True, kw_only=True)
class CarpetHeightConfig:
    """How the sensors err; standard deviations.

    Attributes:
        altimeter_m: white noise of the altitude.
        rangefinder_m: white noise of the height above the surface below.
        wander_m: of the altimeter's slow error; at the take-off there is none ...
        wander_s: ... and its correlation time.
        walk_m: of the integrated vertical velocity, in a second.
        gate_stds: a surface further from where the carpet should be is another; an altitude
            further off means that the vertical velocity does not tell, and the height begins anew,
        gap_s: as it does after a longer time without telemetry.
        agree_m: a rangefinder that differs so little from the altimeter measures to the carpet,
            whatever the estimate,
        differ_m: and one that differs by more does not: the altimeter is never so wrong.
        memory_s: how far back late frames may lie.
    """

    altimeter_m: float = 0.03
    rangefinder_m: float = 0.03
    wander_m: float = 0.05
    wander_s: float = 20.0
    walk_m: float = 0.02
    gate_stds: float = 4.0
    gap_s: float = 1.0
    agree_m: float = 0.1
    differ_m: float = 0.25
    memory_s: float = 3.0


class CarpetHeight:
    """Corrects the height above the carpet in what a drone reports.

    Args:
        config: how the sensors err.
    """

    def __init__(self, config: CarpetHeightConfig | None = None) -> None:
        self._config = config or CarpetHeightConfig()
        self._last: DroneState | None = None
        self._standing_m = 0.0  # height above the carpet where the altimeter shows 0
        self._apart_m = 0.0  # the rangefinder's value less the altimeter's, at first;
        self._ranges = False  # it never changes where there is no rangefinder
        self._sunk_m: deque[tuple[float, float]] = deque()  # by the velocity, at each time
        self._mean_m = np.zeros(2)  # the height less what the drone has sunk, the altimeter's error
        self._covariance = np.zeros((2, 2))
        self._frame: tuple[Frame, Frame] | None = None  # the newest, as it came and corrected

    def corrected(self, observation: Observation) -> Observation:
        """Return an observation with the estimated heights above the carpet.

        Args:
            observation: one after the other, of which every measurement can be.
        """
        state, frame = observation.state, observation.frame
        if math.isfinite(state.captured_s):
            self._take(state)
            state = replace(state, height_above_carpet_m=self._at(state.captured_s))
        return Observation(frame=None if frame is None else self._placed(frame), state=state)

    def _placed(self, frame: Frame) -> Frame:
        if not self._sunk_m:
            return frame
        if self._frame is None or self._frame[0] is not frame:
            height_m = self._at(frame.captured_s)
            self._frame = frame, replace(frame, height_above_carpet_m=height_m)
        return self._frame[1]

    def _at(self, time_s: float) -> float:
        times_s, sunk_m = zip(*self._sunk_m, strict=True)
        return float(self._mean_m[0] - np.interp(time_s, times_s, sunk_m))

    def _take(self, state: DroneState) -> None:
        """Take in a telemetry sample; one that is not newer changes nothing."""
        cfg, last = self._config, self._last
        if last is not None and state.captured_s <= last.captured_s:
            return
        if last is None:
            self._standing_m = state.height_above_carpet_m - state.altitude_m
            self._apart_m = state.height_m - state.altitude_m
        self._last = state
        if last is None or state.captured_s - last.captured_s > cfg.gap_s:
            self._begin(state)
            return
        passed_s = state.captured_s - last.captured_s
        mean_mps = 0.5 * (last.velocity.down_mps + state.velocity.down_mps)
        self._sunk_m.append((state.captured_s, self._sunk_m[-1][1] + mean_mps * passed_s))
        while self._sunk_m[0][0] < state.captured_s - cfg.memory_s:
            self._sunk_m.popleft()
        keeps = math.exp(-passed_s / cfg.wander_s)
        passing = np.array([1.0, keeps])
        self._mean_m = passing * self._mean_m
        self._covariance = passing[:, None] * self._covariance * passing + np.diag(
            [cfg.walk_m**2 * passed_s, cfg.wander_m**2 * (1.0 - keeps**2)]
        )
        sunk_m = self._sunk_m[-1][1]
        altitude_m = self._standing_m + state.altitude_m + sunk_m
        if not self._measure(_ALTIMETER, altitude_m, cfg.altimeter_m):
            self._begin(state)
        self._range(state)

    def _range(self, state: DroneState) -> None:
        """Take in the rangefinder, if there is one and it measures to the carpet."""
        cfg, apart_m = self._config, state.height_m - state.altitude_m
        self._ranges |= abs(apart_m - self._apart_m) > _SAME_M
        differs_m = abs(apart_m - self._standing_m)
        if self._ranges and differs_m <= cfg.differ_m:
            below_m = state.height_m + self._sunk_m[-1][1]
            agrees = differs_m <= cfg.agree_m
            self._measure(_RANGEFINDER, below_m, cfg.rangefinder_m, sure=agrees)

    def _begin(self, state: DroneState) -> None:
        """Believe the altimeter, less the error that is known."""
        cfg, error_m = self._config, float(self._mean_m[1])
        self._sunk_m.clear()
        self._sunk_m.append((state.captured_s, 0.0))
        self._mean_m = np.array([self._standing_m + state.altitude_m - error_m, error_m])
        self._covariance[0] = self._covariance[:, 0] = 0.0
        self._covariance[0, 0] = cfg.altimeter_m**2

    def _measure(
        self, slopes: NDArray[np.float64], value_m: float, std_m: float, *, sure: bool = False
    ) -> bool:
        """Correct by a measurement; return False when it is too far off to be one of these."""
        off_m = value_m - float(slopes @ self._mean_m)
        variance = float(slopes @ self._covariance @ slopes) + std_m**2
        if not sure and abs(off_m) > self._config.gate_stds * math.sqrt(variance):
            return False
        gain = self._covariance @ slopes / variance
        self._mean_m = self._mean_m + gain * off_m
        self._covariance = self._covariance - np.outer(gain, slopes @ self._covariance)
        return True
