"""Speed control: converts velocities to stick positions, which command tilt angles."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from sim_bridge.olympe.config import OlympeConfig
from uav_bt.types import BodyVelocity, Velocity
from uav_bt.types.pose import clamp, limit_length

_GRAVITY_MPS2: Final = 9.81  # standard gravity, rounded
# Share of the speed lost to drag per second; an estimate. Drag is lower at walking speed than the
# 0.55 at full speed (15 m/s at 40 degrees of tilt, from Parrot's data sheet: g tan(40) / 15).
_DRAG_PER_S: Final = 0.4
_PROPORTIONAL_PER_S: Final = 0.8  # chosen: slow compared to the 0.3 s of telemetry and tilt
_INTEGRAL_PER_S2: Final = 0.5  # chosen: it removes the remaining error within some seconds
# Longest time between two commands of one manoeuvre; chosen: nine ticks of 1/30 s. A longer gap
# starts a new manoeuvre.
_MAX_STEP_S: Final = 0.3
# Speed below which a drone that should stop holds its position itself; chosen.
_STANDING_MPS: Final = 0.1
_MIN_TILT_RAD: Final = math.radians(1.0)  # the lowest MaxTilt that an ANAFI accepts


class Sticks(NamedTuple):
    """Stick positions for the SDK, per cent of the largest values in the drone's settings."""

    roll: int = 0  # right positive
    pitch: int = 0  # forward positive
    yaw: int = 0  # clockwise positive
    climb: int = 0  # up positive


class FullSticks(NamedTuple):
    """Meaning of full sticks, by the drone's settings."""

    tilt_rad: float
    climb_mps: float
    yaw_rate_radps: float


def gentle_tilt_rad(config: OlympeConfig) -> float:
    """Return the tilt that reaches the speed limit, for firmware without speeds of movements."""
    steady_rad = math.atan(_DRAG_PER_S * config.speed_limit_mps / _GRAVITY_MPS2)
    return min(config.tilt_limit_rad, max(_MIN_TILT_RAD, steady_rad))


class SpeedHolder:
    """Controls horizontal speeds by the tilt, with feed-forward and PI control.

    The integral part corrects the estimated drag, so that a drone whose sticks command speeds
    reaches the speed, too.
    """

    def __init__(self, config: OlympeConfig) -> None:
        self._config = config
        self.tilt_limit_rad = config.tilt_limit_rad
        self._integral_mps2 = [0.0, 0.0]
        self._last_s = -math.inf

    def reset(self) -> None:
        """Start a new manoeuvre."""
        self._integral_mps2 = [0.0, 0.0]
        self._last_s = -math.inf

    def limited(self, order: Velocity) -> Velocity:
        """Return a velocity within the limits of the configuration."""
        config = self._config
        forward_mps, right_mps = limit_length(
            order.forward_mps, order.right_mps, config.speed_limit_mps
        )
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=clamp(order.down_mps, config.climb_limit_mps),
            yaw_rate_radps=clamp(order.yaw_rate_radps, config.yaw_rate_limit_radps),
        )

    def sticks(
        self, order: Velocity, measured: BodyVelocity, now_s: float, full: FullSticks
    ) -> Sticks:
        """Return the stick positions for a velocity within the limits."""
        step_s = now_s - self._last_s
        if step_s > _MAX_STEP_S:
            self.reset()
            step_s = 0.0
        self._last_s = now_s
        forward_rad = self._tilt_rad(0, order.forward_mps, measured.forward_mps, step_s)
        right_rad = self._tilt_rad(1, order.right_mps, measured.right_mps, step_s)
        return Sticks(
            roll=_percent(right_rad / full.tilt_rad),
            pitch=_percent(forward_rad / full.tilt_rad),
            yaw=_percent(order.yaw_rate_radps / full.yaw_rate_radps),
            climb=_percent(-order.down_mps / full.climb_mps),
        )

    def _tilt_rad(self, axis: int, wanted_mps: float, measured_mps: float, step_s: float) -> float:
        """Return the tilt for one axis, within the limit."""
        if wanted_mps == 0.0 and abs(measured_mps) < _STANDING_MPS:
            # Centred sticks: the drone's position hold is better than this controller.
            self._integral_mps2[axis] = 0.0
            return 0.0
        error_mps = wanted_mps - measured_mps
        limit_mps2 = _GRAVITY_MPS2 * math.tan(self.tilt_limit_rad)
        integral = self._integral_mps2[axis] + _INTEGRAL_PER_S2 * error_mps * step_s
        self._integral_mps2[axis] = integral = clamp(integral, limit_mps2)
        demand = _DRAG_PER_S * wanted_mps + _PROPORTIONAL_PER_S * error_mps + integral
        return math.atan(clamp(demand, limit_mps2) / _GRAVITY_MPS2)


def _percent(share: float) -> int:
    return round(100.0 * clamp(share, 1.0))
