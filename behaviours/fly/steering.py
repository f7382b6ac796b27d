"""Base of the leaves that advance and turn under a leaf policy.

An advance begins only on a class map captured after the last movement ended, as in the paper. A
turn keeps its direction until the policy finds a free view, so that the drone does not oscillate
between two boxes. The drone does not stop for each view: it turns while the policy judges them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar, Final

from behaviours.fly.course_leaf import CourseLeaf, Keys
from behaviours.fly.keeping_away import step_away_m
from behaviours.fly.moving_leaf import Progress
from behaviours.policies.view import VIEW_KEYS, ask, current_view, policy_view
from behaviours.ports import StageTimer
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.board import FLIGHT_PITCH, FRAME, HELD_TURN, ODOMETRY
from uav_bt.board.context import MissionContext
from uav_bt.protocols import LeafPolicy
from uav_bt.tree import Port
from uav_bt.types import DroneState, HeldTurn

POLICY = Port("policy", str, "segmentation", "leaf policy that chooses the way")
LOOKS_DOWN = Port("looks_down", bool, False, "lower the camera where it would show little ground")
GIVES_WAY = Port("gives_way", bool, True, "stop for what moves, and get out of its way")
FLOWING = Port("flowing", bool, False, "look ahead during a step: lengthen it, or break it off")

# Larger errors in height are corrected with the next advance. Smaller ones are altimeter noise.
_ALTITUDE_SLACK_M: Final = 0.08
# Rate of a steady turn: 10 degrees in the 0.3 s from a frame's capture to its effect.
_YAW_RATE_RADPS: Final = 0.6
_TURN_LAG_S: Final = 0.1  # time that a turn continues after the command that ends it
_TURN_BACK_RAD: Final = math.radians(4)  # smaller overshoots of a turn are not corrected
_SETTLE_S: Final = 0.2  # wait after a turn: the swinging airframe would deflect a step
_INTERRUPTED_S: Final = 1.0  # wait after an interrupted movement before a view counts
_LENGTHEN_M: Final = 0.2  # a new step replaces one under way if it ends further on by this


class SteeringLeaf(CourseLeaf):
    """Base of the leaves that move step by step under a leaf policy."""

    points = True
    ports: ClassVar[tuple[Port[Any], ...]] = (POLICY, LOOKS_DOWN)
    reads: ClassVar[Keys] = (*CourseLeaf.reads, FLIGHT_PITCH, *VIEW_KEYS)

    def may_point(self) -> bool:
        """Return False for a leaf whose port `looks_down` is false."""
        return LOOKS_DOWN not in self.ports or self.initial_value(LOOKS_DOWN) is not False

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; raises UnknownNameError if none has that name."""
        self._policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._timer = StageTimer(mission, "policy")
        self._rng = mission.rng(self.path)
        super().on_setup(mission)
        self._view_from_s = -math.inf  # frames captured earlier do not count
        self._advancing = False  # the movement under way, if any, is an advance
        self._step_ends_m, self._stepped_s = 0.0, 0.0  # distance left of the advance under way
        self._begin_to_turn(None)

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch; None, to leave it unchanged, without the port `looks_down`."""
        flight_rad = self.read(FLIGHT_PITCH).value if self.port_value(LOOKS_DOWN.name) else None
        return None if flight_rad is None else self.ground_pitch_rad(flight_rad)

    def gives_way(self) -> bool:
        """Avoid a mover that comes too near, if the port is set; return whether it does so."""
        return bool(self.port_value(GIVES_WAY.name)) and self.give_way()

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False without one."""
        goes_on = super().moving(state)
        if not goes_on:
            wait_s = _INTERRUPTED_S if self.progress is Progress.INTERRUPTED else 0.0
            self._view_from_s = max(self._view_from_s, self._step.ended_s + wait_s)
        return goes_on

    def go_on(self, state: DroneState, answer: Advance | FollowLeg | Rotate | None) -> bool:
        """Begin an advance, or follow a leg or a rotation; True if an advance began."""
        if isinstance(answer, Advance):
            self._advance(state, answer, answer.forward_m)
            return True
        self.fly_on(state, answer)
        return False

    def _advance(self, state: DroneState, answer: Advance, forward_m: float) -> None:
        """Start an advance that also corrects the height."""
        self.write(HELD_TURN, HeldTurn())
        error_m = self.off_height_m(state)
        down_m = error_m if abs(error_m) > _ALTITUDE_SLACK_M else 0.0
        self._advancing, self._step_ends_m, self._stepped_s = True, forward_m, self.clock.now()
        self.start_move(forward_m=forward_m, yaw_rad=answer.yaw_rad, down_m=down_m)

    def flow(self, state: DroneState) -> bool:
        """Judge the view during a step; True if a longer step replaced it, or if it broke off."""
        if not (self._step.busy and self._advancing and self.port_value("flowing")):
            return False
        now_s, motion = self.clock.now(), self.read(ODOMETRY).value
        forward_mps = (state if motion is None else motion.over_ground(state)).velocity.forward_mps
        self._step_ends_m -= forward_mps * (now_s - self._stepped_s)
        self._stepped_s = now_s
        answer, frame = self.decide(), self.read(FRAME).value
        if isinstance(answer, Blocked | Done):
            self.drop_course()
            return True
        if frame is None or not isinstance(answer, Advance):
            return False
        # The answer's distance counts from where the frame was captured.
        ends_m = answer.forward_m - forward_mps * (now_s - frame.captured_s)
        if ends_m < self._step_ends_m + _LENGTHEN_M:
            return False
        self._advance(state, answer, ends_m)
        return True

    def make_room(self) -> bool:
        """Start a step away from an obstacle that is too near; False where none is, or no room."""
        step_m = step_away_m(self.obstacles(), self.mission.clearances.edge_m)
        if step_m is not None:
            self._advancing = False
            self.start_move(forward_m=step_m[0], right_m=step_m[1])
        return step_m is not None

    def drop_course(self) -> None:
        """Drop movement, course and turn; only views captured from now on count."""
        super().drop_course()
        self._view_from_s = self.clock.now() + _SETTLE_S
        self._begin_to_turn(None)

    def _begin_to_turn(self, least_rad: float | None, yaw_rad: float = math.nan) -> None:
        """Begin a turn by at least an angle, at a heading; None: no turn is under way."""
        self.turning = least_rad is not None
        self.turn_left_rad = least_rad or 0.0  # before a free view may end the turn
        self._turn_yaw_rad = yaw_rad  # of the last tick

    @property
    def held_turn(self) -> HeldTurn:
        """The turn held since the last advance of any leaf."""
        return self.read(HELD_TURN).value or HeldTurn()

    def keep_turning(self, state: DroneState, away_rad: float | None) -> None:
        """Continue the turn under way, or begin one by an angle, clockwise positive."""
        yaw_rad, held = state.attitude.yaw_rad, self.held_turn
        if not self.turning:
            if away_rad is None:
                return
            self._begin_to_turn(abs(away_rad), yaw_rad)
        direction = held.direction or (0 if away_rad is None else 1 if away_rad > 0.0 else -1)
        turned_rad = math.remainder(yaw_rad - self._turn_yaw_rad, 2.0 * math.pi)
        self.turn_left_rad -= direction * turned_rad
        self._turn_yaw_rad = yaw_rad
        turned_rad = held.turned_rad + abs(turned_rad)
        self.write(HELD_TURN, replace(held, direction=direction, turned_rad=turned_rad))
        # Views captured during a turn count at once: the turn keeps its direction for all of them.
        self._view_from_s = -math.inf
        self.propose(self.turn_keeping_away(direction * _YAW_RATE_RADPS))

    def turn_back(self, state: DroneState) -> None:
        """End a turn, and turn back to the heading whose view was free.

        The turn has gone on since the frame was captured, and may have passed a narrow free
        direction. Without turning back, the drone would pass it again in every full turn.
        """
        frame, motion = self.read(FRAME).value, self.read(ODOMETRY).value
        self.drop_course()
        if frame is None:
            return
        yaw_rad = state.attitude.yaw_rad if motion is None else motion.reported_yaw_rad
        ends_rad = yaw_rad + self.held_turn.direction * _YAW_RATE_RADPS * _TURN_LAG_S
        back_rad = math.remainder(frame.attitude.yaw_rad - ends_rad, 2.0 * math.pi)
        if abs(back_rad) > _TURN_BACK_RAD:
            self._advancing = False
            self.start_move(yaw_rad=back_rad)

    def wander(self, state: DroneState) -> bool:
        """Advance or turn as the policy decides, in a search or a detour; True if it advances."""
        if self.flow(state) or self.moving(state):
            return False
        answer = self.decide()
        if isinstance(answer, Blocked | Done):  # a search goes on: look round
            if self.turning or not self.make_room():
                self.keep_turning(state, answer.yaw_rad if isinstance(answer, Blocked) else 0.0)
        elif not self.turning:
            return self.go_on(state, answer)
        elif answer is not None and self.turn_left_rad <= 0.0:
            self.turn_back(state)  # judge the view once more, then advance
        else:
            self.keep_turning(state, None)
        return False

    def decide(self) -> Answer | None:
        """Ask the policy about the newest view; None without a view or an answer to it."""
        view = current_view(self)
        if view is None or view[0].captured_s < self._view_from_s:
            self.feedback_message = "waiting for a view"
            return None
        tie_break = float(self._rng.random())
        shown = policy_view(self, view, held=self.held_turn, tie_break=tie_break)
        with self._timer:
            answer = ask(self, self._policy, shown)
        if answer is not None:
            self.feedback_message = answer.reason
        return answer
