"""Numbers of the position hold, and a model of the velocity that results from orders."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median
from typing import Final

from uav_bt.mission.held_landing import HeldLandingConfig
from uav_bt.settings import check_numbers
from uav_bt.types import Airframe, BodyVelocity, rotate
from uav_bt.types.dead_reckoning import MotionEstimate

Vector = tuple[float, float]  # horizontal, in the odometry's frame

# s, memory of past velocities. Chosen: longer than the age of any telemetry.
_PAST_S: Final = 1.0


@dataclass(frozen=True, kw_only=True)
class HoldConfig:
    """Gains and thresholds of the position hold.

    Video is 0.15 to 0.4 s late. That delays only the part of the velocity that telemetry misses,
    which varies slowly; the loop itself is as fast as telemetry, command delay and lag.

    `python -m benchmarks.faults --kind drift velocity-bias` flies these numbers against
    disturbances of 0.1 and 0.2 m/s.

    Attributes:
        gain_per_s: velocity towards the held place per metre of distance, 1/s. Chosen: its
            time constant of 1.7 s is four times command delay and lag.
        pull_mps: greatest velocity towards the held place, m/s. Chosen: reached 0.25 m from the
            place; faster pulls tilt the drone visibly.
        disturbance_mps: greatest disturbance that is estimated, m/s. Chosen: more than the
            benchmark's 0.2 m/s, less than half the speed limit.
        learn_s: time constant of the estimated disturbance, seconds. Chosen: longer than the
            delays of the loop, shorter than the twin's gusts (1.5 s).
        steady_mps: no disturbance is learned while orders differ by more from the velocity that
            they lead to, m/s. Chosen: six times the noise of the twin's velocity.
        swing_s: no disturbance is learned within this time after a `MoveBy` that reached its goal,
            seconds. Chosen: twice the lag.
        on_the_spot_mps: an order of at most this speed keeps a place, m/s. Chosen: turns that
            keep away from an obstacle move slower, flights by velocity faster.
        stopping_s: longest time from an order to stop until the place is chosen, seconds. After a
            `MoveBy` that was broken off, no disturbance is learned within it. Chosen: a drone
            brakes from 1 m/s within it.
        begin_mps: least correction at which a hover is flown as a velocity, m/s. Chosen: below it
            the drone's own hold is left alone.
        end_mps: the hover is left to the drone again below this correction, m/s. Chosen: well below
            `begin_mps`, so that it does not chatter.
        leash_m: greatest distance of the held place from the drone, metres. Chosen: about the
            drone's size, so that a blocked drone does not dash when it comes free.
        leap_mps: a dead reckoning that moves faster leaps, and the held place with it, m/s. Chosen:
            twice the speed limit.
        lost_s: a place that has been further than the leash for this time cannot be held, seconds.
            Chosen: gusts of the twin pass within it (1.5 s).
        move_s: duration of a `MoveBy` besides its flight at `move_mps`, seconds. Chosen: gaining
            speed, braking and settling in the twin.
        move_mps: mean speed of a `MoveBy`, m/s. Chosen: steps of 0.3 to 1 m in the twin.
        aim_mps: a `MoveBy` is not aimed against a smaller disturbance, m/s. Chosen: twice the
            noise of the twin's velocity.
        blind_s: no place is kept, and no `MoveBy` or landing corrected, after this time without
            ground in view, seconds. Chosen: half a turn at 0.6 rad/s; 0 switches the hold off.
        adrift_s: the last disturbance is compensated until this time without ground in view,
            seconds. Chosen: longer than the safety layer waits for a usable frame.
        lately_s: that disturbance is the median of those that were learned in this time, seconds.
            Chosen: a frozen image is noticed within a quarter of it, and until then its disturbance
            is wrong.
        fresh_s: no disturbance is learned after this time without ground in view, seconds. Chosen:
            about `learn_s`.
        landing: speed and end of a held landing.

    Raises:
        ValueRangeError: a number is negative or not finite.
    """

    gain_per_s: float = 0.6
    pull_mps: float = 0.15
    disturbance_mps: float = 0.35
    learn_s: float = 1.1
    steady_mps: float = 0.12
    swing_s: float = 0.5
    on_the_spot_mps: float = 0.15
    stopping_s: float = 1.5
    begin_mps: float = 0.03
    end_mps: float = 0.012
    leash_m: float = 0.4
    leap_mps: float = 2.0
    lost_s: float = 4.0
    move_s: float = 1.3
    move_mps: float = 0.5
    aim_mps: float = 0.04
    blind_s: float = 5.0
    adrift_s: float = 20.0
    lately_s: float = 8.0
    fresh_s: float = 1.0
    landing: HeldLandingConfig = field(default_factory=HeldLandingConfig)

    def __post_init__(self) -> None:
        check_numbers(self, dict.fromkeys(vars(self), 0.0))


class LatelyLearned:
    """The disturbances that were learned in the last seconds.

    Args:
        window_s: the time for which they are kept, seconds.
    """

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._learned: deque[tuple[float, Vector]] = deque()

    def add(self, learned: Vector, now_s: float) -> None:
        """Add one, m/s, at a time, seconds."""
        self._learned.append((now_s, learned))
        while now_s - self._learned[0][0] > self._window_s:
            self._learned.popleft()

    def median(self) -> Vector:
        """Return their median, m/s; 0 before half of the window was learned."""
        if not self._learned or self._learned[-1][0] - self._learned[0][0] < self._window_s / 2:
            return (0.0, 0.0)
        x_mps, y_mps = zip(*(learned for _, learned in self._learned), strict=True)
        return median(x_mps), median(y_mps)


class OrderedMotion:
    """The velocity that orders cause without a disturbance, after delay and lag.

    Args:
        airframe: command delay and lag.
        steady_mps: greatest difference of a steady drone between order and velocity, m/s.
    """

    def __init__(self, airframe: Airframe, steady_mps: float) -> None:
        self._airframe = airframe
        self._steady_mps = steady_mps
        self._waiting: deque[tuple[float, Vector]] = deque()
        self._target: Vector = (0.0, 0.0)
        self._last_s = -math.inf
        self.mps: Vector = (0.0, 0.0)
        self._past: deque[tuple[float, Vector]] = deque()  # of `_PAST_S`, oldest first

    @property
    def steady(self) -> bool:
        """Whether the drone has had time to follow all orders."""
        orders = [self._target, *(order for _, order in self._waiting)]
        return all(math.dist(order, self.mps) < self._steady_mps for order in orders)

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
        self.mps = add(self.mps, share, add(self._target, -1.0, self.mps))
        self._past.append((now_s, self.mps))
        while self._past[0][0] < now_s - _PAST_S:
            self._past.popleft()

    def at(self, time_s: float) -> Vector:
        """Return the velocity at a time within the last second, for older telemetry.

        Without a stored value, at first and after `reset`, it is the present velocity.
        """
        return next((mps for past_s, mps in self._past if past_s >= time_s), self.mps)

    def _take_due(self, now_s: float) -> None:
        while self._waiting and self._waiting[0][0] <= now_s:
            self._target = self._waiting.popleft()[1]

    def reset(self, mps: Vector) -> None:
        """Restart with a velocity that earlier orders did not cause."""
        self._waiting.clear()
        self._past.clear()
        self._target = self.mps = mps


def add(first: Vector, factor: float, second: Vector) -> Vector:
    """Return first + factor * second."""
    return first[0] + factor * second[0], first[1] + factor * second[1]


def in_world(
    motion: MotionEstimate, velocity: BodyVelocity, less: BodyVelocity | None = None
) -> Vector:
    """Return a body's velocity, less another, in the odometry's frame, m/s."""
    less = less or BodyVelocity()
    forward_mps = velocity.forward_mps - less.forward_mps
    return rotate(forward_mps, velocity.right_mps - less.right_mps, motion.pose.yaw_rad)
