"""Height above the ground, estimated from altimeter, rangefinder and vertical velocity.

An altimeter drifts by centimetres with pressure and air flow. The ranges of all points that the
camera places on the ground are wrong by the same share. The rangefinder has no such error, but
measures to the box or the landing pad below the drone. A Kalman filter estimates the height and the
altimeter's error; between two measurements the height follows the vertical velocity. An object
lower than some 0.3 m cannot be distinguished from the ground.

The filter is written here: the runner imports this module in every flight, and filterpy loads
scipy.stats.
"""

from __future__ import annotations

import bisect
import math
from collections import deque
from dataclasses import replace
from operator import itemgetter
from typing import Final

from uav_bt.types import DroneState, Frame, MeasurementTimes, Observation
from uav_bt.types.dead_reckoning import CARRY_S

# Share of the altimeter's error in a measurement; the height counts in full.
_ALTIMETER: Final = 1.0
_RANGEFINDER: Final = 0.0
_SAME_M: Final = 1e-6
_CLIMBS_MPS: Final = 0.1  # least vertical velocity of a drone that reports one; chosen


# Errors of the sensors, chosen for the twin's profiles `lab` and `harsh`.
_ALTIMETER_M: Final = 0.03  # standard deviation of the altitude's white noise
_RANGEFINDER_M: Final = 0.03  # the same of the height above the surface
_WANDER_M: Final = 0.05  # standard deviation of the altimeter's slow error, 0 at the take-off
_WANDER_S: Final = 20.0  # correlation time of that error
# Standard deviation of the integrated vertical velocity after one second; least error of three
# flights of 100 s in each profile, against 0.02 and 0.04.
_WALK_M: Final = 0.03
# A rangefinder further off sees another surface. An altitude further off means that the altimeter
# has stepped, or that the vertical velocity is wrong and the height begins anew.
_GATE_STDS: Final = 4.0
# Least change of an altitude's error to the next altitude, within `_STEP_S`, that is a step of the
# altimeter. A wrong vertical velocity changes it by less: 0.1 m at 0.5 m/s and 5 Hz.
_STEP_M: Final = 0.15
_STEP_S: Final = 0.3
_CALM_S: Final = 1.0  # after a second step within it, the vertical velocity is wrong
_GAP_S: Final = 1.0  # without velocity or altitude for longer, the height begins anew
_AGREE_M: Final = 0.1  # within it of the altimeter, the rangefinder measures the ground in any case
_DIFFER_M: Final = 0.25  # further off it does not: the altimeter is never wrong by more
_MEMORY_S: Final = 3.0  # largest age of a frame


class GroundHeight:
    """Corrects the height above the ground in telemetry and frames.

    Altitude, rangefinder and vertical velocity each count at their capture time. After the newest
    velocity the height is extrapolated for at most `CARRY_S`.
    """

    def __init__(self) -> None:
        self._times: MeasurementTimes | None = None  # of the newest measurements used
        self._standing_m = 0.0  # height above the ground where the altimeter shows 0
        self._apart_m = 0.0  # the first difference of rangefinder and altimeter
        self._ranges = False  # whether that difference ever changed, by a rangefinder
        self._sunk_m: deque[tuple[float, float]] = deque()  # time, and sum of the velocity
        self._down_mps = 0.0  # the newest vertical velocity
        self._height_m = 0.0  # plus the integrated descent
        self._error_m = 0.0  # of the altimeter
        self._off_m = 0.0  # the newest altitude minus its expected value
        self._stepped_s = -math.inf  # time of the newest step of the altimeter
        self._reports = False  # whether a vertical velocity was ever reported
        self._covariance = 0.0, 0.0, 0.0, 0.0  # of height and error, m2, row by row
        self._frame: tuple[Frame, Frame] | None = None  # the newest, original and corrected

    def corrected(self, observation: Observation, now_s: float | None = None) -> Observation:
        """Return an observation with the estimated heights; the state's is that of `now_s`.

        Observations come in the order of time, with plausible measurements. Without `now_s` the
        height of the state is that of its own time.
        """
        state, frame = observation.state, observation.frame
        if math.isfinite(state.captured_s):
            self._take(state)
            sunk_m = self._sunk_at(state.captured_s if now_s is None else now_s)
            state = replace(state, height_above_ground_m=self._height_m - sunk_m)
        if frame is not None and self._sunk_m:
            if self._frame is None or self._frame[0] is not frame:
                height_m = self._height_m - self._sunk_at(frame.captured_s)
                self._frame = frame, replace(frame, height_above_ground_m=height_m)
            frame = self._frame[1]
        return Observation(frame=frame, state=state)

    def _sunk_at(self, time_s: float) -> float:
        """Return the integrated descent at a time, from the vertical velocity."""
        last_s, last_m = self._sunk_m[-1]
        if time_s >= last_s:
            return last_m + self._down_mps * min(time_s - last_s, CARRY_S)
        after = bisect.bisect_right(self._sunk_m, time_s, key=itemgetter(0))
        if after == 0:
            return self._sunk_m[0][1]
        (begin_s, begin_m), (end_s, end_m) = self._sunk_m[after - 1], self._sunk_m[after]
        return (end_m - begin_m) / (end_s - begin_s) * (time_s - begin_s) + begin_m

    def _take(self, state: DroneState) -> None:
        """Use the measurements that are newer than the former ones."""
        before, times = self._times, state.times
        self._times = times
        if before is None:
            self._standing_m = state.height_above_ground_m - state.altitude_m
            self._apart_m = state.height_m - state.altitude_m
            self._begin(state)
            return
        fallen_s = times.velocity_s - before.velocity_s
        passed_s = times.altitude_s - before.altitude_s
        if max(fallen_s, passed_s) > _GAP_S:
            self._begin(state)
            return
        if fallen_s > 0.0:
            mean_mps = 0.5 * (self._down_mps + state.velocity.down_mps)
            self._sunk_m.append((times.velocity_s, self._sunk_m[-1][1] + mean_mps * fallen_s))
            self._down_mps = state.velocity.down_mps
            self._reports |= abs(self._down_mps) > _CLIMBS_MPS
            while self._sunk_m[0][0] < times.velocity_s - _MEMORY_S:
                self._sunk_m.popleft()
        if passed_s > 0.0:
            self._climb(state, passed_s)
        if times.height_s > before.height_s:
            self._range(state)

    def _climb(self, state: DroneState, passed_s: float) -> None:
        """Use an altitude."""
        keeps = math.exp(-passed_s / _WANDER_S)
        hh_m2, he_m2, eh_m2, ee_m2 = self._covariance
        self._error_m *= keeps
        self._covariance = (
            hh_m2 + _WALK_M**2 * passed_s,
            keeps * he_m2,
            keeps * eh_m2,
            keeps * ee_m2 * keeps + _WANDER_M**2 * (1.0 - keeps**2),
        )
        altitude_s = state.times.altitude_s
        altitude_m = self._standing_m + state.altitude_m + self._sunk_at(altitude_s)
        before_m, self._off_m = self._off_m, altitude_m - (self._height_m + self._error_m)
        if self._measure(_ALTIMETER, altitude_m, _ALTIMETER_M):
            return
        steps = abs(self._off_m - before_m) > _STEP_M and passed_s <= _STEP_S
        # Each climb of a drone that reports no vertical velocity looks like steps.
        if self._reports and steps and altitude_s - self._stepped_s > _CALM_S:
            self._standing_m -= self._off_m  # the drone cannot have moved this far
            self._off_m, self._stepped_s = 0.0, altitude_s
        else:
            self._begin(state)

    def _range(self, state: DroneState) -> None:
        """Use the rangefinder, if there is one and it measures to the ground."""
        apart_m = state.height_m - state.altitude_m
        self._ranges |= abs(apart_m - self._apart_m) > _SAME_M
        differs_m = abs(apart_m - self._standing_m)
        if self._ranges and differs_m <= _DIFFER_M:
            below_m = state.height_m + self._sunk_at(state.times.height_s)
            agrees = differs_m <= _AGREE_M
            self._measure(_RANGEFINDER, below_m, _RANGEFINDER_M, sure=agrees)

    def _begin(self, state: DroneState) -> None:
        """Start from the altimeter minus its known error."""
        self._sunk_m.clear()
        self._sunk_m.append((state.times.velocity_s, 0.0))
        self._down_mps = state.velocity.down_mps
        sunk_m = self._sunk_at(state.times.altitude_s)
        self._height_m = self._standing_m + state.altitude_m - self._error_m + sunk_m
        self._off_m, ee_m2 = 0.0, self._covariance[3]
        self._covariance = _ALTIMETER_M**2 + ee_m2, -ee_m2, -ee_m2, ee_m2

    def _measure(self, share: float, value_m: float, std_m: float, *, sure: bool = False) -> bool:
        """Correct by a measurement of the height plus a share of the altimeter's error.

        Returns:
            False if the measurement lies outside the gate and is not `sure`.
        """
        hh_m2, he_m2, eh_m2, ee_m2 = self._covariance
        off_m = value_m - (self._height_m + share * self._error_m)
        row = hh_m2 + share * eh_m2, he_m2 + share * ee_m2
        column = hh_m2 + share * he_m2, eh_m2 + share * ee_m2
        variance_m2 = row[0] + share * row[1] + std_m**2
        if not sure and abs(off_m) > _GATE_STDS * math.sqrt(variance_m2):
            return False
        height_gain, error_gain = column[0] / variance_m2, column[1] / variance_m2
        self._height_m += height_gain * off_m
        self._error_m += error_gain * off_m
        self._covariance = (
            hh_m2 - height_gain * row[0],
            he_m2 - height_gain * row[1],
            eh_m2 - error_gain * row[0],
            ee_m2 - error_gain * row[1],
        )
        return True
