"""The heading controller: a PID from bearing error to yaw rate.

The drone answers a yaw-rate command like a first-order lag behind a dead time; with the integration
to an angle the loop is a lag-plus-integrator, for which a PID with a small integral part does well.
The gains are designed on the twin's identified response (`benchmarks/heading.py` prints its margins).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from simple_pid import PID

from uav_bt.errors import ValueRangeError

__all__ = ["HeadingController", "HeadingGains"]


@dataclass(frozen=True, kw_only=True)
class HeadingGains:
    """Gains of the heading PID."""

    proportional: float = 1.6  # rad/s per rad
    integral: float = 0.10  # 1/s^2: takes out the bearing offset that a steady drift leaves
    derivative: float = 0.10  # damps the approach to the target heading
    max_yaw_rate_radps: float = 1.0  # the output's limit, and the anti-windup's

    def __post_init__(self) -> None:
        if self.max_yaw_rate_radps <= 0.0 or self.proportional <= 0.0:
            raise ValueRangeError(f"gain and yaw-rate limit must be positive, got {self}")


class HeadingController:
    """Turns a bearing to the target into a yaw rate; clockwise is positive for both."""

    def __init__(self, gains: HeadingGains | None = None) -> None:
        self.gains = gains or HeadingGains()
        limit = self.gains.max_yaw_rate_radps
        # simple-pid holds the integral inside the output limits: that is the anti-windup.
        self._pid = PID(
            self.gains.proportional,
            self.gains.integral,
            self.gains.derivative,
            setpoint=0.0,
            sample_time=None,
            output_limits=(-limit, limit),
        )
        self._last_s: float | None = None
        self._output = 0.0

    def reset(self) -> None:
        """Forget the past; call it when the controller takes over."""
        self._pid.reset()
        self._last_s = None
        self._output = 0.0

    def update(self, bearing_rad: float, now_s: float) -> float:
        """Return the yaw rate, rad/s, that turns the heading towards a bearing.

        Args:
            bearing_rad: of the target from the heading, clockwise positive, within [-pi, pi].
            now_s: the mission clock.
        """
        if not math.isfinite(bearing_rad):
            raise ValueRangeError(f"the bearing must be finite, got {bearing_rad}")
        if self._last_s is not None and now_s <= self._last_s:
            return self._output
        # The first call has no past: any small step makes the integral negligible.
        dt = 1e-6 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        # simple-pid's error is setpoint minus input: the heading lags the target by the bearing.
        self._output = float(self._pid(-bearing_rad, dt=dt) or 0.0)
        return self._output
