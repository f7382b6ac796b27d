"""Holds position by feedback from the ground in view, for every leaf.

A drone holds position by its velocity estimate, and drifts with the error of that estimate. The
board's `odometry` shows the motion over the ground. The part of it that no order explains (the
disturbance) is estimated and compensated, and a proportional controller holds the place. The hold
acts between the leaves' proposals and the arbiter's limits:

hover, turn on the spot   flown as a velocity that keeps the place;
velocity flight           flown minus the disturbance;
landing                   flown down by velocities that keep the place, to the height at which the
                          drone's own landing takes over;
`MoveBy`                  flown by the drone itself. It is aimed beforehand against the expected
                          drift, and its goal is the place to keep afterwards.

After a while without ground in view, and without usable frames or telemetry, the place is unknown.
Then only the disturbance of the last seconds with ground is compensated.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from statistics import median
from typing import Final

from uav_bt.mission.hold_model import GroundWatch, HeldLanding, OrderedMotion, Vector, add
from uav_bt.mission.safety import AIRBORNE, Lasting
from uav_bt.types import Airframe, DroneState, MovementState, MovementStatus, limit_length, rotate
from uav_bt.types.commands import Hover, Land, MoveBy, Movement, Velocity
from uav_bt.types.dead_reckoning import MotionEstimate

# Video is 0.15 to 0.4 s late. That delays only the part of the velocity that telemetry misses,
# which varies slowly; the loop itself is as fast as telemetry, command delay and lag. All numbers
# are chosen; `python -m benchmarks.faults --kind drift velocity-bias` flies them against
# disturbances of 0.1 and 0.2 m/s.
_GAIN_PER_S: Final = 0.6  # velocity towards the place per metre: 1.7 s, four times delay and lag
_PULL_MPS: Final = 0.15  # most towards the place, 0.25 m away; faster tilts the drone visibly
_DISTURBANCE_MPS: Final = 0.35  # greatest; more than the benchmark's, below half the speed limit
_LEARN_S: Final = 1.1  # time constant of learning: above the loop's delays, below gusts of 1.5 s
_FRESH_S: Final = 1.0  # without ground in view nothing is learned after it; about `_LEARN_S`
_SWING_S: Final = 0.5  # nothing is learned within it after a `MoveBy`; twice the lag
_ON_THE_SPOT_MPS: Final = 0.15  # fastest order that keeps a place: turns off an obstacle, no flight
_STOPPING_S: Final = 1.5  # from an order to stop to the choice of a place; brakes from 1 m/s
_BEGIN_MPS: Final = 0.03  # least correction of a hover; below it the drone's own hold is left alone
_END_MPS: Final = 0.012  # a corrected hover is left to the drone below it, without chatter
_LEASH_M: Final = 0.4  # from the drone to its place; its size: freed, it must not dash
_LEAP_MPS: Final = 2.0  # a faster dead reckoning leaps, and the place with it; twice the limit
_LOST_S: Final = 4.0  # longest beyond the leash, or the place cannot be held; gusts pass in 1.5 s
_MOVE_S: Final = 1.3  # of a `MoveBy` besides its flight: gaining speed, braking, settling (twin)
_MOVE_MPS: Final = 0.5  # mean speed of a `MoveBy` of 0.3 to 1 m in the twin
_AIM_MPS: Final = 0.04  # least disturbance that a `MoveBy` is aimed against; twice the twin's noise
BLIND_S: Final = 5.0
"""Time without ground in view after which no place is kept; half a turn at 0.6 rad/s."""
_ADRIFT_S: Final = 20.0  # then the last disturbance counts; longer than frames are waited for
_LATELY_S: Final = 8.0  # time of that disturbance; a frozen image is noticed within a quarter of it


class PositionHold:
    """Corrects the movement of a tick by the motion over the ground."""

    def __init__(self, airframe: Airframe | None = None) -> None:
        self._airframe = airframe or Airframe()
        self._ordered = OrderedMotion(self._airframe)
        self._unordered: Vector = (0.0, 0.0)  # of telemetry's velocity: not explained by orders
        self._learned: Vector = (0.0, 0.0)  # the disturbance at the last learning
        self._lately: deque[tuple[float, Vector]] = deque()  # those of the last `_LATELY_S`
        self._here: Vector | None = None  # position in the last tick
        self._place: Vector | None = None  # None in a velocity flight and while it stops
        self._move: MoveBy | None = None  # the present one, as it is sent
        self._goal: Vector | None = None  # its goal; None once it is unknown
        self._known: MotionEstimate | None = None  # the last one over the ground
        self._landing: HeldLanding | None = None  # a landing that is flown by velocities
        self._lands_itself = False  # the drone, until something else is proposed
        self._stopping = Lasting(gap_s=0.0)  # ordered to stop, but no place chosen yet
        self._last_s = self._learns_from_s = -math.inf
        self._holds = False  # a hover is being corrected
        self._lost = Lasting()
        self.watch = GroundWatch()
        self.trouble: str | None = None  # why the place cannot be held

    def correct(
        self, movement: Movement, state: DroneState, motion: MotionEstimate | None, now_s: float
    ) -> Movement:
        """Return a proposed movement as it should be flown, by the motion over the ground."""
        passed_s = min(now_s - self._last_s, 1.0)
        self._last_s = now_s
        if isinstance(movement, Land) and self._lands_itself:
            return movement
        if motion is None or state.flying not in AIRBORNE:
            self.rest()
            return movement
        self._ordered.advance(now_s)
        self._known = motion
        if motion.untracked_s > BLIND_S:
            return self.against_drift(movement, state, now_s)
        leapt = self._follow_leap((motion.pose.x_m, motion.pose.y_m), passed_s)
        if isinstance(movement, MoveBy):
            return self._aim(movement, motion)
        goal = self._end_move(state)
        order = self._order(movement, state, passed_s)
        if order is None:
            self.rest()
            return movement
        if not leapt:
            self._learn(motion, passed_s)
        self._keep_place(order, motion, passed_s, goal)
        return self._corrected(movement, order, motion.pose.yaw_rad, self._correction(motion))

    def against_drift(self, movement: Movement, state: DroneState, now_s: float) -> Movement:
        """Return a movement against the disturbance of the last seconds with ground in view."""
        motion, order = self._known, _velocity(movement)
        self.rest()
        if state.flying not in AIRBORNE or order is None:
            return movement
        if motion is None or now_s - motion.tracked_s > _ADRIFT_S:
            return movement
        extra: Vector = (0.0, 0.0)  # before half of the time was learned
        if self._lately and self._lately[-1][0] - self._lately[0][0] >= _LATELY_S / 2:
            x_mps, y_mps = zip(*(learned for _, learned in self._lately), strict=True)
            extra = (-median(x_mps), -median(y_mps))
        yaw_rad = state.attitude.yaw_rad + motion.turn_rad  # the drone may have turned since
        return self._corrected(movement, order, yaw_rad, extra)

    def _corrected(
        self, movement: Movement, order: Velocity, yaw_rad: float, extra: Vector
    ) -> Movement:
        """Return an order with a correction; a hover that needs none is left to the drone."""
        if isinstance(movement, Hover):
            self._holds = math.hypot(*extra) > (_END_MPS if self._holds else _BEGIN_MPS)
            if not self._holds:
                return movement
        # The drone turns on until the order takes effect.
        yaw_rad += order.yaw_rate_radps * self._airframe.command_delay_s
        forward_mps, right_mps = rotate(*extra, -yaw_rad)
        return replace(
            order,
            forward_mps=order.forward_mps + forward_mps,
            right_mps=order.right_mps + right_mps,
        )

    def sent(
        self, movement: Movement, motion: MotionEstimate | None, now_s: float, *, rests: bool
    ) -> None:
        """Note the movement that was sent in this tick; it `rests` where a safety rule decided."""
        self.watch.update(motion, now_s)
        lands, order = isinstance(movement, Land), _velocity(movement)
        if lands or rests:
            self.rest()
            self._lands_itself = lands
        if motion is not None and order is not None:
            mps = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
            self._ordered.order(mps, now_s)

    def rest(self) -> None:
        """Drop the place: a person flies, or the motion is unknown; the drone flies a move on."""
        self._here = self._place = self._goal = self._landing = None
        self._lands_itself = self._holds = False
        self._stopping.reset()

    @property
    def disturbance_mps(self) -> float:
        """Speed of the disturbance that was learned last, m/s."""
        return math.hypot(*self._learned)

    def _order(self, movement: Movement, state: DroneState, passed_s: float) -> Velocity | None:
        """Return the velocity to fly a movement by, None to leave it to the drone."""
        self._lands_itself = False
        if not isinstance(movement, Land):
            self._landing = None
            return _velocity(movement)
        self._landing = self._landing or HeldLanding(state.height_m)
        down_mps = self._landing.order(state.height_m, passed_s)
        return None if down_mps is None else Velocity(down_mps=down_mps)

    def _follow_leap(self, here: Vector, passed_s: float) -> bool:
        """Shift the place with a leap of dead reckoning; return whether there was one."""
        before, self._here = self._here, here
        if before is None:
            return False
        moved = add(here, -1.0, before)
        if math.hypot(*moved) <= _LEAP_MPS * passed_s:
            return False
        self._place = self._place and add(self._place, 1.0, moved)
        self._goal = self._goal and add(self._goal, 1.0, moved)
        return True

    # --- the disturbance --------------------------------------------------------------------------

    def _learn(self, motion: MotionEstimate, passed_s: float) -> None:
        """Update the part of telemetry's velocity that no order explains."""
        settled = self._ordered.steady and self._last_s >= self._learns_from_s
        if motion.untracked_s > _FRESH_S or not settled:
            return
        forward_mps = motion.velocity.forward_mps - motion.drift.forward_mps
        right_mps = motion.velocity.right_mps - motion.drift.right_mps
        reported = rotate(forward_mps, right_mps, motion.pose.yaw_rad)
        measured_s = motion.pose.time_s if motion.velocity_s is None else motion.velocity_s
        beyond = add(reported, -1.0, self._ordered.at(measured_s))
        share = 1.0 - math.exp(-passed_s / _LEARN_S)
        learned = add(self._unordered, share, add(beyond, -1.0, self._unordered))
        self._unordered = limit_length(*learned, _DISTURBANCE_MPS)
        self._learned = self._disturbance(motion)
        self._lately.append((self._last_s, self._learned))
        while self._last_s - self._lately[0][0] > _LATELY_S:
            self._lately.popleft()

    def _disturbance(self, motion: MotionEstimate) -> Vector:
        drift = motion.drift
        missed = rotate(drift.forward_mps, drift.right_mps, motion.pose.yaw_rad)
        return limit_length(*add(missed, 1.0, self._unordered), _DISTURBANCE_MPS)

    def _correction(self, motion: MotionEstimate) -> Vector:
        pull: Vector = (0.0, 0.0)
        if self._place is not None:
            away = add((motion.pose.x_m, motion.pose.y_m), -1.0, self._place)
            pull = limit_length(-_GAIN_PER_S * away[0], -_GAIN_PER_S * away[1], _PULL_MPS)
        return add(pull, -1.0, self._disturbance(motion))

    # --- the place --------------------------------------------------------------------------------

    def _keep_place(
        self, order: Velocity, motion: MotionEstimate, passed_s: float, goal: Vector | None
    ) -> None:
        """Choose the place to keep, or move the kept place by a slow order."""
        now_s, here = self._last_s, (motion.pose.x_m, motion.pose.y_m)
        wanted = rotate(order.forward_mps, order.right_mps, motion.pose.yaw_rad)
        if math.hypot(*wanted) > _ON_THE_SPOT_MPS:
            self._place = None
            self._stopping.reset()
            return
        place = self._place or goal
        if place is None:
            stopping_s = self._stopping.update(now_s, holds=True)
            speed_mps = math.hypot(motion.velocity.forward_mps, motion.velocity.right_mps)
            if speed_mps > _ON_THE_SPOT_MPS and stopping_s < _STOPPING_S:
                return
            place = here
        self._stopping.reset()
        away = add(add(place, passed_s, wanted), -1.0, here)
        self._place = add(here, 1.0, limit_length(*away, _LEASH_M))
        if self._lost.update(now_s, holds=math.hypot(*away) > _LEASH_M) > _LOST_S:
            self.trouble = (
                f"it drifts although {self.disturbance_mps:.2f} m/s are held against it: "
                "is there wind?"
            )

    def _aim(self, move: MoveBy, motion: MotionEstimate) -> MoveBy:
        """Return a movement that ends at its goal in spite of the drift."""
        self._landing, self._lands_itself = None, False
        if self._move is not None and self._move.id == move.id:
            return self._move
        self._place = None
        self._stopping.reset()
        self._holds = False
        lasts_s = _MOVE_S + math.hypot(move.forward_m, move.right_m, move.down_m) / _MOVE_MPS
        size_mps = max(self.disturbance_mps, _AIM_MPS)
        sure_s = lasts_s * (1.0 - (_AIM_MPS / size_mps) ** 2)
        forward_mps, right_mps = rotate(*self._learned, -motion.pose.yaw_rad)
        self._goal = motion.pose.to_world(move.forward_m, move.right_m)
        self._move = replace(
            move,
            forward_m=move.forward_m - forward_mps * sure_s,
            right_m=move.right_m - right_mps * sure_s,
        )
        return self._move

    def _end_move(self, state: DroneState) -> Vector | None:
        """Drop the present movement; return its goal if it is done."""
        (move, self._move), (goal, self._goal) = (self._move, None), (self._goal, None)
        if move is None:
            return None
        self._ordered.stop()
        done = state.movement == MovementStatus(id=move.id, state=MovementState.DONE)
        # A drone that breaks off a movement is still fast, which is no disturbance.
        self._learns_from_s = self._last_s + (_SWING_S if done else _STOPPING_S)
        return goal if done else None


def _velocity(movement: Movement) -> Velocity | None:
    """Return a hover or a velocity as a velocity; None for other movements."""
    if isinstance(movement, Hover):
        return Velocity()
    return movement if isinstance(movement, Velocity) else None
