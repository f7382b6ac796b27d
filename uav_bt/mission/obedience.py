"""Notices a drone that does not obey, by comparing commands with telemetry."""

from __future__ import annotations

import math
from typing import Final

from uav_bt.board.keys import STATE
from uav_bt.mission.safety import AIRBORNE, Lasting
from uav_bt.types import DroneState, FlyingState, MovementState
from uav_bt.types.commands import Command, Hover, Land, MoveBy, Movement, TakeOff, Velocity

# All chosen.
_START_S: Final = 6.0  # until a gimbal points or a landing begins; a take-off has twice as long
_MOVEMENT_S: Final = 4.0  # superseded later, a movement is undone; a step of 0.3 m takes 2 s
_UNDONE: Final = 3  # such movements in a row; one or two are lost messages
_LONGEST_S: Final = 40.0  # of one movement; 10 m with 0.25 m/s
_GIMBAL_RAD: Final = math.radians(6)  # error of the pitch; three times what leaves accept
_TURNED_SHARE: Final = 0.3  # least, of the ordered turns; half the ordered rate obeys
_TURN_RAD: Final = math.radians(150)  # ordered turn that the share is of; 4.4 s at 0.6 rad/s
_TURN_ANSWER_S: Final = 0.6  # until an ordered turn shows; delay, lag and a period of telemetry
_INTERRUPTIONS: Final = 6  # in a row; a leaf makes five attempts at one movement
_INTERRUPTED_S: Final = 5.0  # from the first to the last of them; a gust is shorter
_DRIFT_MPS: Final = 0.25  # mean speed of a hovering drone; 1 m within `_DRIFT_S`
_DRIFT_S: Final = 4.0  # of that mean; gusts are shorter


class ObedienceWatch:
    """Compares commands with telemetry, tick by tick."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._yaw_rad = 0.0
        self._move: MoveBy | None = None
        self._not_landing, self._not_rising, self._away, self._unended, self._broken_off = (
            Lasting(gap_s=0.0) for _ in range(5)
        )
        self._asked_rad = self._turned_rad = 0.0  # ordered turns, and telemetry's share in them
        self._turning = Lasting(gap_s=0.0)  # ordered by velocity in one direction
        self._direction = 0.0  # of that turn: 1 clockwise, -1 counter-clockwise
        self._answered = 0.0  # direction of the turn that telemetry shows by now
        self._answered_until_s = -math.inf
        self._move_turned_rad = 0.0  # by telemetry, during the present movement
        self._ended = False  # whether telemetry reported the end of that movement
        self._interrupted = self._undone = 0  # movements in a row
        self._gimbal_rad: float | None = None
        self._drift_m = (0.0, 0.0)
        self._hover_s = 0.0

    def complaint(self, command: Command, state: DroneState, now_s: float) -> str | None:
        """Return a complaint about a disobedient drone, by the command that was sent; or None."""
        passed_s = 0.0 if self._last_s is None else now_s - self._last_s
        turned_rad = math.remainder(state.attitude.yaw_rad - self._yaw_rad, math.tau)
        self._last_s, self._yaw_rad = now_s, state.attitude.yaw_rad
        if now_s - state.captured_s > STATE.max_age_s:
            # Old telemetry says nothing about the present, nor about the time until it is new.
            for lasting in (self._not_landing, self._not_rising, self._away, self._unended):
                lasting.reset()
            return None
        self._move_turned_rad += turned_rad
        movement, camera = command.movement, "its camera does not point where it should"
        if command.gimbal is not None:
            self._gimbal_rad = command.gimbal.pitch_rad
        refuses = isinstance(movement, Land) and state.flying in AIRBORNE
        stays = isinstance(movement, TakeOff) and state.flying is FlyingState.LANDED
        away = (
            self._gimbal_rad is not None
            and state.times.gimbal_s > -math.inf  # else it reports no pitch
            and abs(state.gimbal_pitch_rad - self._gimbal_rad) > _GIMBAL_RAD
        )
        found = (
            self._not_landing.update(now_s, holds=refuses) > _START_S and "it does not land",
            self._not_rising.update(now_s, holds=stays) > 2 * _START_S and "it does not take off",
            self._movement(movement, state, now_s),
            self._not_turning(movement, passed_s, turned_rad, now_s),
            self._away.update(now_s, holds=away) > _START_S and f"{camera}: is the gimbal stuck?",
            self._drifting(movement, state, passed_s),
        )
        return next((each for each in found if each), None)

    def _movement(self, movement: Movement, state: DroneState, now_s: float) -> str | None:
        """Complain about movements in a row that the drone breaks off or does not finish."""
        move = movement if isinstance(movement, MoveBy) else None
        self._hear_of(self._move, state)
        interrupted_s = self._broken_off.update(now_s, holds=self._interrupted > 0)
        lasted_s = self._unended.update(now_s, holds=self._move is not None)
        if move is None or self._move is None or move.id != self._move.id:
            # A step may be superseded early by the next one.
            if self._move is not None and not self._ended and lasted_s > _MOVEMENT_S:
                self._undone += 1
            self._unended.reset()
            self._ended = False
            self._move_turned_rad = 0.0
        self._move = move
        if self._interrupted >= _INTERRUPTIONS and interrupted_s > _INTERRUPTED_S:
            return f"{self._interrupted} movements in a row were interrupted"
        if self._undone >= _UNDONE or lasted_s > _LONGEST_S:
            return "its movements are not done"
        return None

    def _hear_of(self, move: MoveBy | None, state: DroneState) -> None:
        """Note the end of the newest movement."""
        status = state.movement
        if move is None or self._ended or status is None or status.id != move.id:
            return
        if status.state is MovementState.DONE:
            self._asked_rad += abs(move.yaw_rad)
            self._turned_rad += _sign(move.yaw_rad) * self._move_turned_rad
            self._interrupted = self._undone = 0
        elif status.state is not MovementState.RUNNING:
            self._interrupted += 1
        self._ended = status.state is not MovementState.RUNNING

    def _not_turning(
        self, movement: Movement, passed_s: float, turned_rad: float, now_s: float
    ) -> str | None:
        """Complain about a drone that does not turn in the ordered direction.

        A turn by velocity counts while it lasts, one by `MoveBy` when it is done. Turns the other
        way count as negative, so heading noise averages out. The answer to a turn by velocity
        begins and ends later than the turn, and its end counts too: of short turns to and fro it
        is the greater part.
        """
        rate_radps = movement.yaw_rate_radps if isinstance(movement, Velocity) else 0.0
        if rate_radps * self._direction <= 0.0:
            self._turning.reset()
            self._direction = _sign(rate_radps)
        if self._turning.update(now_s, holds=rate_radps != 0.0) > _TURN_ANSWER_S:
            self._asked_rad += abs(rate_radps) * passed_s
            self._answered = self._direction
            self._answered_until_s = now_s + _TURN_ANSWER_S
        if now_s <= self._answered_until_s:
            self._turned_rad += self._answered * turned_rad
        if self._asked_rad < _TURN_RAD:
            return None
        share = self._turned_rad / self._asked_rad
        self._asked_rad = self._turned_rad = 0.0
        return "it does not turn" if share < _TURNED_SHARE else None

    def _drifting(self, movement: Movement, state: DroneState, passed_s: float) -> str | None:
        """Complain about a drone that drifts while it hovers."""
        hovers = isinstance(movement, Hover) and state.flying is FlyingState.HOVERING
        if hovers:
            forward_m, right_m = self._drift_m
            forward_m += state.velocity.forward_mps * passed_s
            right_m += state.velocity.right_mps * passed_s
            self._drift_m, self._hover_s = (forward_m, right_m), self._hover_s + passed_s
            if self._hover_s < _DRIFT_S:
                return None
        speed_mps = math.hypot(*self._drift_m) / self._hover_s if hovers else 0.0
        self._drift_m, self._hover_s = (0.0, 0.0), 0.0
        if speed_mps <= _DRIFT_MPS:
            return None
        return f"it drifts at {speed_mps:.2f} m/s while it should hover: is there wind?"


def _sign(value: float) -> float:
    return math.copysign(1.0, value) if value else 0.0
