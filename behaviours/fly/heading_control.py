"""The heading controller: a PID from bearing error to yaw rate.

The drone responds to a yaw-rate command like a first-order lag with a dead time. With the
integration to an angle the loop is a lag plus an integrator, which a PID with a small integral part
controls well. The gains were designed on the twin's identified response
(`benchmarks.heading_design`). A test checks the margins, and `benchmarks/heading.py` prints them.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from simple_pid import PID

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class HeadingGains:
    """Gains of the heading PID."""

    # rad/s per rad: the largest tenth with 6 dB and 45 deg of margin in the twin's profile
    # `harsh`, whose heading arrives 0.12 to 0.32 s late (tests/benchmarks/test_heading_design.py)
    proportional: float = 1.2
    integral: float = 0.10  # 1/s^2: removes the bearing offset that a steady drift leaves
    derivative: float = 0.10  # damps the approach to the target heading
    max_yaw_rate_radps: float = 1.0  # the output's limit
    # The integral only acts this close to the target. It corrects a steady drift; accumulated on a
    # long turn at the output's limit, it would cause an overshoot.
    integral_zone_rad: float = math.radians(12)

    def __post_init__(self) -> None:
        values = dataclasses.asdict(self)
        finite = all(math.isfinite(value) for value in values.values())
        positive = min(self.proportional, self.max_yaw_rate_radps, self.integral_zone_rad) > 0.0
        if not finite or not positive or min(self.integral, self.derivative) < 0.0:
            raise ValueRangeError(
                "proportional gain, yaw-rate limit and integral zone must be positive, the other "
                f"gains zero or positive, all finite; got {self}"
            )


class HeadingController:
    """Turns a bearing to the target into a yaw rate; clockwise is positive for both."""

    def __init__(self, gains: HeadingGains | None = None) -> None:
        self.gains = gains or HeadingGains()
        limit = self.gains.max_yaw_rate_radps
        # simple-pid also clamps the integral to the output limits; `update` does the rest of the
        # anti-windup.
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
        """Reset the controller; call it when the controller takes over."""
        self._pid.reset()
        self._last_s = None
        self._output = 0.0

    def update(self, bearing_rad: float, now_s: float) -> float:
        """Return the yaw rate, rad/s, that turns the heading towards a bearing.

        A second call at the same time returns the same yaw rate.

        Args:
            bearing_rad: Bearing of the target from the heading, clockwise positive, in [-pi, pi].
            now_s: Time of the mission clock.

        Raises:
            ValueRangeError: bearing or time is not finite; the state is unchanged.
        """
        if not (math.isfinite(bearing_rad) and math.isfinite(now_s)):
            raise ValueRangeError(f"bearing and time must be finite, got {bearing_rad}, {now_s}")
        if self._last_s is not None and now_s <= self._last_s:
            return self._output
        # The first call has no predecessor: with a small time step the integral is negligible.
        dt = 1e-6 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        inside = abs(bearing_rad) <= self.gains.integral_zone_rad
        self._pid.Ki = self.gains.integral if inside else 0.0
        # simple-pid's error is setpoint minus input, so the input is minus the bearing.
        self._output = float(self._pid(-bearing_rad, dt=dt) or 0.0)
        return self._output
