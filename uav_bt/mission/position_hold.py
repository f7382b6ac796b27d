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
from dataclasses import replace

from uav_bt.mission.ground_watch import GroundWatch
from uav_bt.mission.ordered_motion import HoldConfig, OrderedMotion, Vector, add, limited
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


class PositionHold:
    """Corrects the movement of a tick by what the ground shows.

    Args:
        config: gains and limits.
    """

    def __init__(self, config: HoldConfig | None = None) -> None:
        self._config = config or HoldConfig()
        self._ordered = OrderedMotion(self._config)
        self._unordered: Vector = (0.0, 0.0)  # of telemetry's velocity: beyond the orders
        self._learned: Vector = (0.0, 0.0)  # the disturbance when it was last seen by itself
        self._here: Vector | None = None  # where it was a tick ago
        self._place: Vector | None = None
        self._goal: Vector | None = None  # of the movement in hand
        self._aimed: MoveBy | None = None
        self._stopping_s: float | None = None  # since when it should stop, no place being kept yet
        self._landing_s: float | None = None  # since when it lands
        self._last_s = self._learns_from_s = -math.inf
        self._holds = False  # a hover is being corrected
        self._lost = Lasting()
        self._watch = GroundWatch()
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
        leapt = self._follow_leap((motion.pose.x_m, motion.pose.y_m), passed_s)
        if isinstance(movement, MoveBy):
            return self._aim(movement, motion)
        done = self._end_move(state)
        order = self._order(movement, state, now_s)
        if order is None:
            self.rest()
            return movement
        if not leapt:
            self._learn(motion, passed_s)
        wanted = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
        self._keep_place(wanted, motion, passed_s, done, now_s)
        extra = self._correction(motion)
        if isinstance(movement, Hover):
            min_mps = cfg.end_mps if self._holds else cfg.begin_mps
            self._holds = math.hypot(*extra) > min_mps
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

    def sent(
        self,
        movement: Movement,
        motion: MotionEstimate | None,
        now_s: float,
        *,
        rests: bool = False,
    ) -> None:
        """Note what was decided in this tick.

        Args:
            movement: what is sent.
            motion: as the ground shows it, None where nothing does.
            now_s: mission clock.
            rests: whether it was not the leaves that decided.
        """
        self._watch.update(motion, now_s)
        if rests:
            self.rest()
        if motion is None or not isinstance(movement, Hover | Velocity):
            return
        order = movement if isinstance(movement, Velocity) else Velocity()
        mps = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
        self._ordered.order(mps, now_s)

    def rest(self) -> None:
        """Give up the place: somebody else flies, or nothing is known."""
        self._here = self._place = self._goal = self._aimed = self._stopping_s = None
        self._holds = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the ground shows to be wrong with telemetry, while it does."""
        return () if self._watch.warning is None else (self._watch.warning,)

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

    def _follow_leap(self, here: Vector, passed_s: float) -> bool:
        """Carry the place along where dead reckoning leaps; return whether it does."""
        before, self._here = self._here, here
        if before is None:
            return False
        moved = add(here, -1.0, before)
        if math.hypot(*moved) <= self._config.leap_mps * passed_s:
            return False
        self._place = None if self._place is None else add(self._place, 1.0, moved)
        self._goal = None if self._goal is None else add(self._goal, 1.0, moved)
        return True

    # --- what disturbs it -------------------------------------------------------------------------

    def _learn(self, motion: MotionEstimate, passed_s: float) -> None:
        """Update what telemetry shows beyond the orders; what it misses is the odometry's."""
        cfg = self._config
        settled = self._ordered.steady and self._last_s >= self._learns_from_s
        if motion.untracked_s > cfg.fresh_s or not settled:
            return
        reported = _world(motion, motion.velocity, less=motion.error)
        measured_s = motion.pose.time_s if motion.velocity_s is None else motion.velocity_s
        beyond = add(reported, -1.0, self._ordered.at(measured_s))
        share = 1.0 - math.exp(-passed_s / cfg.learn_s)
        self._unordered = limited(
            add(self._unordered, share, add(beyond, -1.0, self._unordered)), cfg.disturbance_mps
        )
        self._learned = self._disturbance(motion)

    def _disturbance(self, motion: MotionEstimate) -> Vector:
        missed = _world(motion, motion.error)
        return limited(add(missed, 1.0, self._unordered), self._config.disturbance_mps)

    def _correction(self, motion: MotionEstimate) -> Vector:
        cfg, pull = self._config, (0.0, 0.0)
        if self._place is not None:
            away = add((motion.pose.x_m, motion.pose.y_m), -1.0, self._place)
            pull = limited((-cfg.gain_per_s * away[0], -cfg.gain_per_s * away[1]), cfg.pull_mps)
        return add(pull, -1.0, self._disturbance(motion))

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
        away = add(add(self._place, passed_s, wanted), -1.0, here)
        self._place = add(here, 1.0, limited(away, cfg.leash_m))
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


def _world(
    motion: MotionEstimate, velocity: BodyVelocity, less: BodyVelocity | None = None
) -> Vector:
    """Return a body's velocity in the odometry's frame."""
    less = less or BodyVelocity()
    forward_mps = velocity.forward_mps - less.forward_mps
    return rotate(forward_mps, velocity.right_mps - less.right_mps, motion.pose.yaw_rad)
