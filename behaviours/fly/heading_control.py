"""The heading controller: a PID from bearing error to yaw rate.

The drone answers a yaw-rate command as a first-order lag behind a delay, and the rate integrates to
an angle. A PID with a small integral part controls such a loop well. The gains are designed on the
twin's response. `uav-bt lab tune-heading` identifies the response of another drone from a recorded
flight and prints the margins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from simple_pid import PID

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class HeadingGains:
    """Gains of the heading PID."""

    # rad/s per rad: the largest tenth with 6 dB and 45 deg of margin in the twin's profile
    # `harsh`, whose telemetry is 0.12 to 0.32 s old (tests/uav_bt/app/test_heading_tuning.py)
    proportional: float = 1.2
    integral: float = 0.10  # 1/s^2: removes the bearing offset of a steady drift
    derivative: float = 0.10  # damps the approach to the target heading
    max_yaw_rate_radps: float = 1.0  # the output's limit
    # Bearing within which the integral works. It corrects a steady drift. On a long turn, at the
    # output's limit, it would grow and carry the heading past the target.
    integral_zone_rad: float = math.radians(12)

    def __post_init__(self) -> None:
        gains = (self.proportional, self.integral, self.derivative)
        if not all(0.0 <= gain < math.inf for gain in gains):
            raise ValueRangeError(f"gains must be finite and not negative, got {gains}")


class HeadingController:
    """Turns a bearing to the target into a yaw rate; clockwise is positive for both."""

    def __init__(self, gains: HeadingGains | None = None) -> None:
        self.gains = gains or HeadingGains()
        limit = self.gains.max_yaw_rate_radps
        # simple-pid keeps the integral within the output limits; `update` adds the integral's zone.
        terms = self.gains.proportional, self.gains.integral, self.gains.derivative
        self._pid = PID(*terms, setpoint=0.0, sample_time=None, output_limits=(-limit, limit))
        self.reset()

    def reset(self) -> None:
        """Reset the controller; call it when the controller takes over."""
        self._pid.reset()
        self._last_s: float | None = None
        self._output = 0.0

    def update(self, bearing_rad: float, now_s: float) -> float:
        """Return the yaw rate, rad/s, towards a bearing, clockwise; the same for the same time."""
        if self._last_s is not None and now_s <= self._last_s:
            return self._output
        # The first call has no time step: a small one makes the integral negligible.
        dt = 1e-6 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        inside = abs(bearing_rad) <= self.gains.integral_zone_rad
        self._pid.Ki = self.gains.integral if inside else 0.0
        # simple-pid's error is setpoint minus input: the heading lags the target by the bearing.
        self._output = float(self._pid(-bearing_rad, dt=dt) or 0.0)
        return self._output
