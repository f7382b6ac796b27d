"""Speeds to stick positions: an ANAFI's sticks are tilt angles, ours are metres a second."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_bridge.olympe.config import OlympeConfig
from uav_bt.types import BodyVelocity, Velocity

__all__ = ["CENTRED", "SpeedHolder", "Sticks"]

_GRAVITY_MPS2: Final = 9.81
# A drone at 40 degrees reaches 15 m/s: g tan(40) / 15 m/s. At walking pace the air resists less.
_DRAG_PER_S: Final = 0.4
_PROPORTIONAL_PER_S: Final = 0.8  # slow beside the 0.3 s that telemetry and tilt take
_INTEGRAL_PER_S2: Final = 0.5
_LONGEST_STEP_S: Final = 0.3  # between two orders of one manoeuvre


@dataclass(frozen=True, kw_only=True)
class Sticks:
    """Stick positions as the SDK takes them, percent of what the drone was set up for."""

    roll: int = 0  # right positive
    pitch: int = 0  # forward positive
    yaw: int = 0  # clockwise positive
    climb: int = 0  # up positive


CENTRED: Final = Sticks()


class SpeedHolder:
    """Holds horizontal speeds by tilting: feed-forward, proportional and integral.

    The integral makes up for what the drag is not, so that a drone that takes its sticks for
    speeds is held at the same speed.
    """

    def __init__(self, config: OlympeConfig) -> None:
        self._config = config
        self._integral_mps2 = [0.0, 0.0]
        self._last_s = -math.inf

    def reset(self) -> None:
        """Forget the manoeuvre before."""
        self._integral_mps2 = [0.0, 0.0]
        self._last_s = -math.inf

    def limited(self, order: Velocity) -> Velocity:
        """Return an order within the limits that the drone was given."""
        config = self._config
        speed = math.hypot(order.forward_mps, order.right_mps)
        share = min(1.0, config.speed_limit_mps / speed) if speed else 1.0
        return Velocity(
            forward_mps=order.forward_mps * share,
            right_mps=order.right_mps * share,
            down_mps=_clamp(order.down_mps, config.climb_limit_mps),
            yaw_rate_radps=_clamp(order.yaw_rate_radps, config.yaw_rate_limit_radps),
        )

    def sticks(self, order: Velocity, measured: BodyVelocity, now_s: float) -> Sticks:
        """Return the stick positions for an order.

        Args:
            order: within the limits.
            measured: what the drone last said about its speed.
            now_s: the clock's time.
        """
        config = self._config
        step_s = now_s - self._last_s
        if step_s > _LONGEST_STEP_S:
            self._integral_mps2 = [0.0, 0.0]
            step_s = 0.0
        self._last_s = now_s
        forward = self._tilt(0, order.forward_mps, measured.forward_mps, step_s)
        right = self._tilt(1, order.right_mps, measured.right_mps, step_s)
        return Sticks(
            roll=_percent(right / config.tilt_limit_rad),
            pitch=_percent(forward / config.tilt_limit_rad),
            yaw=_percent(order.yaw_rate_radps / config.yaw_rate_limit_radps),
            climb=_percent(-order.down_mps / config.climb_limit_mps),
        )

    def _tilt(self, axis: int, wanted_mps: float, measured_mps: float, step_s: float) -> float:
        """Return the tilt for one axis, radians, within the limit."""
        if wanted_mps == 0.0 and abs(measured_mps) < 0.1:
            # Centred sticks: the drone's own position hold is better than ours.
            self._integral_mps2[axis] = 0.0
            return 0.0
        error = wanted_mps - measured_mps
        limit = _GRAVITY_MPS2 * math.tan(self._config.tilt_limit_rad)
        wound = self._integral_mps2[axis] + _INTEGRAL_PER_S2 * error * step_s
        self._integral_mps2[axis] = _clamp(wound, limit)
        demand = _DRAG_PER_S * wanted_mps + _PROPORTIONAL_PER_S * error + self._integral_mps2[axis]
        return math.atan(_clamp(demand, limit) / _GRAVITY_MPS2)


def _percent(share: float) -> int:
    return round(100.0 * _clamp(share, 1.0))


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
