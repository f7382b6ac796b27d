"""Parts of the position hold: the ordered motion, a landing, and the watch of the ground."""

from __future__ import annotations

import logging
import math
from collections import deque
from typing import Final

from uav_bt.mission.safety import Lasting
from uav_bt.types import Airframe, BodyVelocity
from uav_bt.types.dead_reckoning import MotionEstimate

Vector = tuple[float, float]  # horizontal, in the odometry's frame

_LOG: Final = logging.getLogger(__name__)

# All chosen.
_PAST_S: Final = 1.0  # memory of past velocities; longer than the age of any telemetry
_STEADY_MPS: Final = 0.12  # between order and velocity; six times the noise of the twin's velocity
_OFF_MPS: Final = 0.08  # greatest error of telemetry's velocity; four times the twin's noise
_OFF_S: Final = 3.0  # shortest duration of a reported error; twice the twin's gusts

# A held landing; all chosen.
_SPEED_PER_S: Final = 0.6  # speed per metre of height: from 0.75 m down the drone slows
_LEAST_MPS: Final = 0.2  # below the 0.25 m/s of the twin's touch-down
_MOST_MPS: Final = 0.45  # the twin's own landing has 0.5 m/s
_OWN_FROM_M: Final = 0.2  # the drone's own landing lasts 0.8 s from here: drifts of 0.1 m/s, 8 cm
_OVERRUN: Final = 1.5  # from 0.6 m above a box the drone may drift off it, which adds 0.4 m


class OrderedMotion:
    """The velocity that orders cause without a disturbance, after the drone's delay and lag."""

    def __init__(self, airframe: Airframe) -> None:
        self._airframe = airframe
        self._waiting: deque[tuple[float, Vector]] = deque()
        self._target: Vector = (0.0, 0.0)
        self._last_s = -math.inf
        self._mps: Vector = (0.0, 0.0)
        self._past: deque[tuple[float, Vector]] = deque()  # of `_PAST_S`, oldest first

    @property
    def steady(self) -> bool:
        """Whether the drone has had time to follow all orders."""
        orders = [self._target, *(order for _, order in self._waiting)]
        return all(math.dist(order, self._mps) < _STEADY_MPS for order in orders)

    def order(self, mps: Vector, now_s: float) -> None:
        """Note an order that is sent now."""
        self._take_due(now_s)
        self._waiting.append((now_s + self._airframe.command_delay_s, mps))

    def advance(self, now_s: float) -> None:
        """Let time pass."""
        self._take_due(now_s)
        passed_s, lag_s = max(0.0, now_s - self._last_s), self._airframe.command_lag_s
        share = 1.0 - math.exp(-passed_s / lag_s) if lag_s > 0.0 else 1.0
        self._last_s = now_s
        self._mps = add(self._mps, share, add(self._target, -1.0, self._mps))
        self._past.append((now_s, self._mps))
        while self._past[0][0] < now_s - _PAST_S:
            self._past.popleft()

    def at(self, time_s: float) -> Vector:
        """Return the velocity at a time within the last second, for older telemetry.

        Without a stored value, at first and after `stop`, it is the present velocity.
        """
        return next((mps for past_s, mps in self._past if past_s >= time_s), self._mps)

    def _take_due(self, now_s: float) -> None:
        while self._waiting and self._waiting[0][0] <= now_s:
            self._target = self._waiting.popleft()[1]

    def stop(self) -> None:
        """Restart with a standing drone: earlier orders did not cause its velocity."""
        self._waiting.clear()
        self._past.clear()
        self._target = self._mps = (0.0, 0.0)


class HeldLanding:
    """The vertical speed of one landing by velocities, from a height above the surface below."""

    def __init__(self, height_m: float) -> None:
        self._most_m = _OVERRUN * height_m  # ordered in all; else the height does not sink
        self._ordered_m = 0.0
        self._down_mps = 0.0

    def order(self, height_m: float, passed_s: float) -> float | None:
        """Return the speed of the descent, m/s; None once the drone's own landing takes over."""
        self._ordered_m += self._down_mps * passed_s
        if height_m <= _OWN_FROM_M or self._ordered_m > self._most_m:
            return None
        self._down_mps = min(max(_SPEED_PER_S * height_m, _LEAST_MPS), _MOST_MPS)
        return self._down_mps


class GroundWatch:
    """Reports a difference between the motion over the ground and telemetry's velocity.

    The mission flies by the ground in any case.
    """

    def __init__(self) -> None:
        self._off = Lasting()
        self.warnings: tuple[str, ...] = ()  # one while they disagree

    def update(self, motion: MotionEstimate | None, now_s: float) -> None:
        """Check the motion over the ground in a tick; None where it is unknown."""
        error = BodyVelocity() if motion is None else motion.error
        off_mps = math.hypot(error.forward_mps, error.right_mps)
        lasted_s = self._off.update(now_s, holds=off_mps > _OFF_MPS)
        if off_mps <= _OFF_MPS:
            self.warnings = ()
        elif lasted_s > _OFF_S and not self.warnings:
            warning = (
                f"the ground moves by {off_mps:.2f} m/s otherwise than the drone's velocity says: "
                "it drifts without noticing, or reports a wrong velocity; flying by vision instead"
            )
            self.warnings = (warning,)
            _LOG.warning("%s", warning)


def add(first: Vector, factor: float, second: Vector) -> Vector:
    """Return first + factor * second."""
    return first[0] + factor * second[0], first[1] + factor * second[1]
