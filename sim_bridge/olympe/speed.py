"""Speed control: converts velocities to stick positions, which command tilt angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_bridge.olympe.config import GRAVITY_MPS2, OlympeConfig
from uav_bt.types import BodyVelocity, Velocity
from uav_bt.types.pose import clamp, limit_length

# Longest time between two commands of one manoeuvre, s; chosen: nine ticks of 1/30 s. A longer gap
# starts a new manoeuvre.
_MAX_STEP_S: Final = 0.3
# Speed below which a drone that should stop holds its position itself, m/s; chosen.
_STANDING_MPS: Final = 0.1


@dataclass(frozen=True, kw_only=True)
class Sticks:
    """Stick positions for the SDK, per cent of the largest values in the drone's settings."""

    roll: int = 0  # right positive
    pitch: int = 0  # forward positive
    yaw: int = 0  # clockwise positive
    climb: int = 0  # up positive


class SpeedHolder:
    """Controls horizontal speeds by the tilt, with feed-forward and PI control.

    The integral part corrects the estimated drag, so that a drone whose sticks command speeds
    reaches the speed, too.

    Args:
        config: limits and gains.
    """

    def __init__(self, config: OlympeConfig) -> None:
        self._config = config
        self.tilt_limit_rad = config.tilt_limit_rad  # tilt at full stick
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

    def sticks(self, order: Velocity, measured: BodyVelocity, now_s: float) -> Sticks:
        """Return the stick positions for a velocity.

        Args:
            order: wanted velocity, within the limits.
            measured: latest measured velocity.
            now_s: time of the clock, s.
        """
        config = self._config
        step_s = now_s - self._last_s
        if step_s > _MAX_STEP_S:
            self._integral_mps2 = [0.0, 0.0]
            step_s = 0.0
        self._last_s = now_s
        forward = self._tilt(0, order.forward_mps, measured.forward_mps, step_s)
        right = self._tilt(1, order.right_mps, measured.right_mps, step_s)
        return Sticks(
            roll=_percent(right / self.tilt_limit_rad),
            pitch=_percent(forward / self.tilt_limit_rad),
            yaw=_percent(order.yaw_rate_radps / config.yaw_rate_limit_radps),
            climb=_percent(-order.down_mps / config.climb_limit_mps),
        )

    def _tilt(self, axis: int, wanted_mps: float, measured_mps: float, step_s: float) -> float:
        """Return the tilt for one axis within the limit, rad."""
        if wanted_mps == 0.0 and abs(measured_mps) < _STANDING_MPS:
            # Centred sticks: the drone's position hold is better than this controller.
            self._integral_mps2[axis] = 0.0
            return 0.0
        error = wanted_mps - measured_mps
        config = self._config
        limit = GRAVITY_MPS2 * math.tan(self.tilt_limit_rad)
        wound = self._integral_mps2[axis] + config.integral_per_s2 * error * step_s
        self._integral_mps2[axis] = clamp(wound, limit)
        demand = config.drag_per_s * wanted_mps + config.proportional_per_s * error
        demand += self._integral_mps2[axis]
        return math.atan(clamp(demand, limit) / GRAVITY_MPS2)


def _percent(share: float) -> int:
    return round(100.0 * clamp(share, 1.0))
