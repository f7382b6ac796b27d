"""What a drone's velocity would be if it did exactly as it was ordered, and the hold's numbers."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

Vector = tuple[float, float]  # horizontal, in the odometry's frame

_PAST_S = 1.0  # s that past velocities are kept; chosen, beyond any telemetry that is flown by


@dataclass(frozen=True, kw_only=True)
class HoldConfig:
    """Gains, limits, and when nothing is corrected.

    The estimate lags by the video (0.15 to 0.4 s) only in what telemetry misses, which varies
    slowly; the loop itself is as fast as telemetry, a command's delay and the drone's own lag.

    Attributes:
        gain_per_s: from the distance to the place to a velocity: well below one over the delays.
        pull_mps: that velocity's limit.
        disturbance_mps: limit of the estimated disturbance.
        learn_s: time constant of that estimate.
        delay_s: from a command to its first effect.
        lag_s: of the velocity behind a command that has arrived.
        steady_mps: what a drone does about a command that changed by more is not learned from.
        swing_s: nor is what it does so soon after a movement of its own.
        on_the_spot_mps: an order of at most this is one to stay about where it is.
        stopping_s: the place is where a drone that flew has stopped, at the latest after so long.
        begin_mps: a hover is only corrected by a velocity of at least this ...
        end_mps: ... until it falls to this: centred sticks leave it to the drone's own hold.
        leash_m: a place further away is given up for a nearer one.
        leap_mps: no drone flies that fast: dead reckoning leaps, and the place with it.
        lost_s: a place that is given up for so long cannot be held.
        move_s: a movement, and what follows it, take about so long ...
        move_mps: ... and besides its length at this speed.
        aim_mps: a disturbance of this size may as well be none for the aim.
        blind_s: after so long without ground in view nothing is corrected.
        fresh_s: what is older is not learned from.
        land_per_s: speed of a landing for a metre of height above the surface ...
        land_mps: ... not slower, and not faster, than these ...
        land_from_m: ... until the drone's own landing begins at this height ...
        land_s: ... or after so long: the height may be wrong.
    """

    gain_per_s: float = 0.6
    pull_mps: float = 0.15
    disturbance_mps: float = 0.35
    learn_s: float = 1.1
    delay_s: float = 0.15
    lag_s: float = 0.25
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
    fresh_s: float = 1.0
    land_per_s: float = 0.6
    land_mps: tuple[float, float] = (0.2, 0.45)
    land_from_m: float = 0.2
    land_s: float = 6.0


class OrderedMotion:
    """What the drone's velocity would be if nothing disturbed it: orders, delayed and lagging."""

    def __init__(self, config: HoldConfig) -> None:
        self._config = config
        self._waiting: deque[tuple[float, Vector]] = deque()
        self._target: Vector = (0.0, 0.0)
        self._last_s = -math.inf
        self.mps: Vector = (0.0, 0.0)
        self._past: deque[tuple[float, Vector]] = deque()  # of `_PAST_S`, oldest first

    @property
    def steady(self) -> bool:
        """Whether the drone has had the time to do as it was ordered."""
        orders = [self._target, *(order for _, order in self._waiting)]
        return all(math.dist(order, self.mps) < self._config.steady_mps for order in orders)

    def order(self, mps: Vector, now_s: float) -> None:
        """Note an order."""
        self._take_due(now_s)
        self._waiting.append((now_s + self._config.delay_s, mps))

    def advance(self, now_s: float) -> None:
        """Let time pass."""
        self._take_due(now_s)
        passed_s = max(0.0, now_s - self._last_s)
        share = 1.0 - math.exp(-passed_s / self._config.lag_s)
        self._last_s = now_s
        self.mps = add(self.mps, share, add(self._target, -1.0, self.mps))
        self._past.append((now_s, self.mps))
        while self._past[0][0] < now_s - _PAST_S:
            self._past.popleft()

    def at(self, time_s: float) -> Vector:
        """Return the velocity of a moment of the last second, for telemetry that is older than now.

        It is the present velocity where none is kept: at first, and after `reset`.
        """
        return next((mps for past_s, mps in self._past if past_s >= time_s), self.mps)

    def _take_due(self, now_s: float) -> None:
        while self._waiting and self._waiting[0][0] <= now_s:
            self._target = self._waiting.popleft()[1]

    def reset(self, mps: Vector) -> None:
        """Begin anew with what it does now: it was not ordered from here."""
        self._waiting.clear()
        self._past.clear()
        self._target = self.mps = mps


def add(first: Vector, times: float, second: Vector) -> Vector:
    """Return the sum of a vector and so many times another."""
    return first[0] + times * second[0], first[1] + times * second[1]


def limited(vector: Vector, length: float) -> Vector:
    """Return a vector that is no longer than that."""
    share = min(1.0, length / (math.hypot(*vector) or 1.0))
    return share * vector[0], share * vector[1]
