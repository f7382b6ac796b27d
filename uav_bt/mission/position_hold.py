"""Position hold: closes the loop on what the drone sees of the ground, whichever leaf flies it.

A drone holds the place that its own velocity estimate believes in, and drifts with that estimate's
error. The board's `odometry` shows the motion over the ground; what the drone does beyond its
orders (the disturbance) is estimated from it and ordered back, and the place itself is held by a
proportional controller. Between the leaves' proposals and the arbiter's limits, so that every leaf
and every mission has it:

hover, turn on the spot   flown as a velocity that keeps the place;
velocity flight           gets the disturbance taken off;
landing                   is a descent that keeps the place, and the drone's own landing at its end;
`MoveBy`                  is flown by the drone itself: it is aimed beforehand for the drift of the
                          time that it will take, and afterwards its goal is the place to keep.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from uav_bt.mission.safety import Lasting
from uav_bt.types import (
    BodyVelocity,
    DroneState,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    Velocity,
    rotate,
)
from uav_bt.types.dead_reckoning import MotionEstimate

Vector = tuple[float, float]  # horizontal, in the odometry's frame


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


class _OrderedMotion:
    """What the drone's velocity would be if nothing disturbed it: orders, delayed and lagging."""

    def __init__(self, config: HoldConfig) -> None:
        self._config = config
        self._waiting: deque[tuple[float, Vector]] = deque()
        self._target: Vector = (0.0, 0.0)
        self._last_s = -math.inf
        self.mps: Vector = (0.0, 0.0)

    @property
    def steady(self) -> bool:
        """Whether the drone has had the time to do as it was ordered."""
        orders = [self._target, *(order for _, order in self._waiting)]
        return all(math.dist(order, self.mps) < self._config.steady_mps for order in orders)

    def order(self, mps: Vector, now_s: float) -> None:
        """Note an order."""
        self._waiting.append((now_s + self._config.delay_s, mps))

    def advance(self, now_s: float) -> None:
        """Let time pass."""
        while self._waiting and self._waiting[0][0] <= now_s:
            self._target = self._waiting.popleft()[1]
        passed_s = max(0.0, now_s - self._last_s)
        share = 1.0 - math.exp(-passed_s / self._config.lag_s)
        self._last_s = now_s
        self.mps = _sum(self.mps, share, _sum(self._target, -1.0, self.mps))

    def reset(self, mps: Vector) -> None:
        """Begin anew with what it does now: it was not ordered from here."""
        self._waiting.clear()
        self._target = self.mps = mps


class PositionHold:
    """Corrects the movement of a tick by what the ground shows.

    Args:
        config: gains and limits.
    """

    def __init__(self, config: HoldConfig | None = None) -> None:
        self._config = config or HoldConfig()
        self._ordered = _OrderedMotion(self._config)
        self._unordered: Vector = (0.0, 0.0)  # of telemetry's velocity: beyond the orders
        self._learned: Vector = (0.0, 0.0)  # the disturbance when it was last seen by itself
        self._place: Vector | None = None
        self._goal: Vector | None = None  # of the movement in hand
        self._aimed: MoveBy | None = None
        self._stopping_s: float | None = None  # since when it should stop, no place being kept yet
        self._landing_s: float | None = None  # since when it lands
        self._last_s = self._learns_from_s = -math.inf
        self._holds = False  # a hover is being corrected
        self._lost = Lasting()
        self.trouble: str | None = None  # why the place cannot be held

    def correct(
        self, movement: Movement, state: DroneState, motion: MotionEstimate | None, now_s: float
    ) -> Movement:
        """Return the movement as it should be flown.

        Args:
            movement: as it was proposed.
            state: newest telemetry.
            motion: as the ground shows it, None where nothing does.
            now_s: mission clock.
        """
        cfg, passed_s = self._config, min(now_s - self._last_s, 1.0)
        self._last_s = now_s
        if motion is None or motion.untracked_s > cfg.blind_s or not self._flies(state):
            self.rest()
            return movement
        self._ordered.advance(now_s)
        if isinstance(movement, MoveBy):
            return self._aim(movement, motion)
        done = self._end_move(state)
        order = self._order(movement, state, now_s)
        if order is None:
            self.rest()
            return movement
        self._learn(motion, passed_s)
        wanted = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
        self._keep_place(wanted, motion, passed_s, done, now_s)
        extra = self._correction(motion)
        if isinstance(movement, Hover):
            least_mps = cfg.end_mps if self._holds else cfg.begin_mps
            self._holds = math.hypot(*extra) > least_mps
            if not self._holds:
                return movement
        # It will have turned on by the time at which it does this.
        yaw_rad = motion.pose.yaw_rad + order.yaw_rate_radps * cfg.delay_s
        forward_mps, right_mps = rotate(*extra, -yaw_rad)
        return replace(
            order,
            forward_mps=order.forward_mps + forward_mps,
            right_mps=order.right_mps + right_mps,
        )

    def sent(self, movement: Movement, motion: MotionEstimate | None, now_s: float) -> None:
        """Note what was really sent in this tick."""
        if motion is None or not isinstance(movement, Hover | Velocity):
            return
        order = movement if isinstance(movement, Velocity) else Velocity()
        mps = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
        self._ordered.order(mps, now_s)

    def rest(self) -> None:
        """Give up the place: somebody else flies, or nothing is known."""
        self._place = self._goal = self._aimed = self._stopping_s = None
        self._holds = False

    @property
    def disturbance_mps(self) -> float:
        """How fast it would be carried away, as was learned last."""
        return math.hypot(*self._learned)

    def _order(self, movement: Movement, state: DroneState, now_s: float) -> Velocity | None:
        """Return the velocity that a movement is flown by, None to leave it to the drone.

        A landing is flown down, so that nothing carries it away, and its end left to the drone.
        """
        cfg = self._config
        if not isinstance(movement, Land):
            self._landing_s = None
        if isinstance(movement, Velocity):
            return movement
        if isinstance(movement, Hover):
            return Velocity()
        if not isinstance(movement, Land):
            return None
        self._landing_s = now_s if self._landing_s is None else self._landing_s
        if state.height_m <= cfg.land_from_m or now_s - self._landing_s > cfg.land_s:
            self._landing_s = -math.inf  # and stays the drone's
            return None
        down_mps = min(max(cfg.land_per_s * state.height_m, cfg.land_mps[0]), cfg.land_mps[1])
        return Velocity(down_mps=down_mps)

    def _flies(self, state: DroneState) -> bool:
        return state.flying in {FlyingState.HOVERING, FlyingState.FLYING}

    # --- what disturbs it -------------------------------------------------------------------------

    def _learn(self, motion: MotionEstimate, passed_s: float) -> None:
        """Update what telemetry shows beyond the orders; what it misses is the odometry's."""
        cfg = self._config
        settled = self._ordered.steady and self._last_s >= self._learns_from_s
        if motion.untracked_s > cfg.fresh_s or not settled:
            return
        told = _world(motion, motion.velocity, less=motion.error)
        beyond = _sum(told, -1.0, self._ordered.mps)
        share = 1.0 - math.exp(-passed_s / cfg.learn_s)
        self._unordered = _limited(
            _sum(self._unordered, share, _sum(beyond, -1.0, self._unordered)), cfg.disturbance_mps
        )
        self._learned = self._disturbance(motion)

    def _disturbance(self, motion: MotionEstimate) -> Vector:
        missed = _world(motion, motion.error)
        return _limited(_sum(missed, 1.0, self._unordered), self._config.disturbance_mps)

    def _correction(self, motion: MotionEstimate) -> Vector:
        cfg, pull = self._config, (0.0, 0.0)
        if self._place is not None:
            away = _sum((motion.pose.x_m, motion.pose.y_m), -1.0, self._place)
            pull = _limited((-cfg.gain_per_s * away[0], -cfg.gain_per_s * away[1]), cfg.pull_mps)
        return _sum(pull, -1.0, self._disturbance(motion))

    # --- the place --------------------------------------------------------------------------------

    def _keep_place(
        self,
        wanted: Vector,
        motion: MotionEstimate,
        passed_s: float,
        goal: Vector | None,
        now_s: float,
    ) -> None:
        """Choose the place to keep, or go on with it: it moves as slowly as is ordered."""
        cfg, here = self._config, (motion.pose.x_m, motion.pose.y_m)
        if math.hypot(*wanted) > cfg.on_the_spot_mps:
            self._place = self._stopping_s = None
            return
        if self._place is None and goal is not None:
            self._place = goal
        if self._place is None:
            if self._stopping_s is None:
                self._stopping_s = now_s
            speed_mps = math.hypot(motion.velocity.forward_mps, motion.velocity.right_mps)
            if speed_mps > cfg.on_the_spot_mps and now_s - self._stopping_s < cfg.stopping_s:
                return
            self._place = here
        self._stopping_s = None
        away = _sum(_sum(self._place, passed_s, wanted), -1.0, here)
        self._place = _sum(here, 1.0, _limited(away, cfg.leash_m))
        lost_s = self._lost.update(now_s, holds=math.hypot(*away) > cfg.leash_m)
        if lost_s > cfg.lost_s:
            self.trouble = (
                f"it drifts although {self.disturbance_mps:.2f} m/s are held against it: "
                "is there wind?"
            )

    # --- movements of the drone's own -------------------------------------------------------------

    def _aim(self, move: MoveBy, motion: MotionEstimate) -> MoveBy:
        """Return a movement that ends where it was meant to, for all that drifts meanwhile."""
        if self._aimed is not None and self._aimed.id == move.id:
            return self._aimed
        self._place = self._stopping_s = None
        self._holds = False
        self._goal = motion.pose.to_world(move.forward_m, move.right_m)
        cfg = self._config
        length_m = math.hypot(move.forward_m, move.right_m, move.down_m)
        lasts_s = cfg.move_s + length_m / cfg.move_mps
        size_mps = max(self.disturbance_mps, cfg.aim_mps)
        sure_s = lasts_s * (1.0 - (cfg.aim_mps / size_mps) ** 2)
        forward_mps, right_mps = rotate(*self._learned, -motion.pose.yaw_rad)
        self._aimed = replace(
            move,
            forward_m=move.forward_m - forward_mps * sure_s,
            right_m=move.right_m - right_mps * sure_s,
        )
        return self._aimed

    def _end_move(self, state: DroneState) -> Vector | None:
        """Forget the movement in hand; return its goal when it is done."""
        aimed, goal, status = self._aimed, self._goal, state.movement
        self._aimed = self._goal = None
        if aimed is None:
            return None
        self._ordered.reset((0.0, 0.0))
        self._learns_from_s = self._last_s + self._config.swing_s
        done = status is not None and (status.id, status.state) == (aimed.id, MovementState.DONE)
        return goal if done else None


def _sum(first: Vector, times: float, second: Vector) -> Vector:
    return first[0] + times * second[0], first[1] + times * second[1]


def _limited(vector: Vector, length: float) -> Vector:
    share = min(1.0, length / (math.hypot(*vector) or 1.0))
    return share * vector[0], share * vector[1]


def _world(
    motion: MotionEstimate, velocity: BodyVelocity, less: BodyVelocity | None = None
) -> Vector:
    """Return a body's velocity in the odometry's frame."""
    less = less or BodyVelocity()
    forward_mps = velocity.forward_mps - less.forward_mps
    return rotate(forward_mps, velocity.right_mps - less.right_mps, motion.pose.yaw_rad)
