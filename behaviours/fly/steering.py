"""What Explore, Avoid and ReturnToBase share: ask the policy about a view, move, wait.

An advance only begins on a class map captured after the last movement ended, as in the paper.
A turn is held in one direction until it has worked, so that the drone does not oscillate between
two boxes, and it does not stop for each view: the drone turns while the policy judges them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from behaviours.fly.course_leaf import CourseLeaf
from behaviours.fly.held_rotation import HeldRotation
from behaviours.fly.keeping_away import step_away_m
from behaviours.fly.step import Progress
from behaviours.policies.view import VIEW_KEYS, ask, current_view, policy_view
from behaviours.stage_timer import StageTimer
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.board import FLIGHT_PITCH, FRAME, HELD_TURN, ODOMETRY
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.protocols import LeafPolicy
from uav_bt.tree import Port
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, HeldTurn

POLICY = Port("policy", str, default="segmentation", doc="leaf policy that chooses the way")
LOOKS_DOWN = Port(
    "looks_down",
    bool,
    default=False,
    doc="lower the camera where, by the site map, it would show little ground to follow",
)
GIVES_WAY = Port(
    "gives_way", bool, default=False, doc="stop for what moves, and get out of its way"
)
FLOWING = Port(
    "flowing", bool, default=False, doc="look ahead during a step: lengthen it, or break it off"
)


@dataclass(frozen=True, kw_only=True)
class SteeringConfig:
    """How steps and turns are flown. Distances are from the body's centre."""

    altitude_slack_m: float = 0.08  # the altimeter's noise; more is corrected with the next advance
    # Of a steady turn: in the 0.3 s from a frame's capture to its effect it turns by 10 degrees.
    yaw_rate_radps: float = 0.6
    turn_lag_s: float = 0.1  # for which a turn goes on after the command that ends it is sent
    turn_back_rad: float = math.radians(4)  # a smaller overshoot of a turn is left
    settle_s: float = 0.2  # the airframe swings on after a turn and would deflect a step
    interrupted_s: float = 1.0  # from an interrupted movement to the view that decides the next one
    lengthen_m: float = 0.2  # a step under way is only replaced by one that ends further on by this


class SteeringLeaf(CourseLeaf):
    """Base of the leaves that move step by step under a leaf policy."""

    steering: ClassVar[SteeringConfig] = SteeringConfig()
    ports: ClassVar[tuple[Port[Any], ...]] = (POLICY, LOOKS_DOWN)
    reads: ClassVar[tuple[Key[Any], ...]] = (*CourseLeaf.reads, FLIGHT_PITCH, *VIEW_KEYS)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy.

        Raises:
            UnknownNameError: no policy has that name.
        """
        self._policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._timer = StageTimer(mission, "policy")
        self._clearances = mission.clearances
        self._rng: np.random.Generator = mission.rng(self.path)
        super().on_setup(mission)
        self._view_from_s = -math.inf  # frames captured earlier show another view
        self._advancing = False  # the movement under way, if any, is an advance
        self._step_ends_m = 0.0  # ahead, of the advance under way
        self._stepped_s = 0.0
        self._rotation = HeldRotation()

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch with the port `looks_down`, None to leave it as it is."""
        flight_rad = self.read(FLIGHT_PITCH).value
        if flight_rad is None or not self.port_value(LOOKS_DOWN.name):
            return None
        return self.ground_pitch_rad(flight_rad)

    def gives_way(self) -> bool:
        """Give way with the port `gives_way`; False when nothing comes too near."""
        return bool(self.port_value(GIVES_WAY.name)) and self.give_way()

    # --- advancing --------------------------------------------------------------------------------

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more)."""
        goes_on = super().moving(state)
        if not goes_on:
            wait_s = self.steering.interrupted_s if self.progress is Progress.INTERRUPTED else 0.0
            self._view_from_s = max(self._view_from_s, self._step.ended_s + wait_s)
        return goes_on

    def go_on(self, state: DroneState, answer: Advance | FollowLeg | Rotate | None) -> bool:
        """Begin an advance, or fly on a leg or a rotation.

        Args:
            state: of the drone.
            answer: to the present view; None without one.

        Returns:
            Whether an advance began.
        """
        if isinstance(answer, Advance):
            self._advance(state, answer)
            return True
        self.fly_on(state, answer)
        return False

    def _advance(self, state: DroneState, answer: Advance, *, flown_m: float = 0.0) -> None:
        """Start an advance that corrects the altitude, too.

        Args:
            state: of the drone.
            answer: how far, and in which direction.
            flown_m: of it, since the frame was captured.
        """
        self.write(HELD_TURN, HeldTurn())
        error_m = self.too_high_m(state)
        self._advancing = True
        self._step_ends_m = answer.forward_m - flown_m
        self._stepped_s = self.clock.now()
        self.start_move(
            forward_m=self._step_ends_m,
            yaw_rad=answer.yaw_rad,
            down_m=error_m if abs(error_m) > self.steering.altitude_slack_m else 0.0,
        )

    def flow(self, state: DroneState) -> bool:
        """Judge the view during a step: replace it by one that leads further, or break it off.

        Returns:
            True when one of both was done; False when the step goes on, or no step is under way.
        """
        if not (self._step.busy and self._advancing and self.port_value("flowing")):
            return False
        now_s, motion = self.clock.now(), self.read(ODOMETRY).value
        forward_mps = (state if motion is None else motion.over_ground(state)).velocity.forward_mps
        self._step_ends_m -= forward_mps * (now_s - self._stepped_s)
        self._stepped_s = now_s
        answer, frame = self.decide(), self.read(FRAME).value
        if frame is None:
            return False
        match answer:
            case Blocked() | Done():
                self.drop_course()
                return True
            case Advance():
                # The answer was given for the place where the frame was captured.
                flown_m = forward_mps * (now_s - frame.captured_s)
                if answer.forward_m - flown_m >= self._step_ends_m + self.steering.lengthen_m:
                    self._advance(state, answer, flown_m=flown_m)
                    return True
        return False

    def make_room(self) -> bool:
        """Start a step away from an obstacle that is too near.

        Returns:
            False when none is, or when the step would lead nearer to another.
        """
        keep_away, edge_m = self.course.keep_away, self._clearances.edge_m
        step_m = step_away_m(self.obstacles(), keep_away, edge_m)
        if step_m is None:
            return False
        self._advancing = False
        self.start_move(forward_m=step_m[0], right_m=step_m[1])
        return True

    # --- turning ----------------------------------------------------------------------------------

    def drop_course(self) -> None:
        """Forget movement, course and turn; only views from now on count."""
        super().drop_course()
        self._view_from_s = self.clock.now() + self.steering.settle_s
        self._rotation = HeldRotation()

    @property
    def turning(self) -> bool:
        """True while a turn is under way."""
        return self._rotation.under_way

    @property
    def turn_is_complete(self) -> bool:
        """True when the drone has turned as far as the policy asked, or no turn is under way."""
        return self._rotation.complete

    @property
    def held_turn(self) -> HeldTurn:
        """The turn held since the last advance, by whichever leaf."""
        return self.read(HELD_TURN).value or HeldTurn()

    def keep_turning(self, state: DroneState, away_rad: float | None) -> None:
        """Begin a turn, or go on with the one under way.

        Args:
            state: of the drone.
            away_rad: the least turn, clockwise positive; None to begin none.
        """
        yaw_rad, held = state.attitude.yaw_rad, self.held_turn
        if not self.turning:
            if away_rad is None:
                return
            self._rotation.begin(abs(away_rad), yaw_rad=yaw_rad)
        direction = held.direction
        if direction == 0 and away_rad is not None:
            direction = 1 if away_rad > 0.0 else -1
        turned_rad = held.turned_rad + abs(self._rotation.go_on(yaw_rad, direction))
        self.write(HELD_TURN, replace(held, direction=direction, turned_rad=turned_rad))
        # Views captured while turning count at once: the direction is the same for all of them.
        self._view_from_s = -math.inf
        self.propose(self.turn_keeping_away(direction * self.steering.yaw_rate_radps))

    def turn_back(self, state: DroneState) -> None:
        """End a turn at the heading whose view was free, and judge the view from there again.

        A steady turn has gone on since the frame was captured, past a free direction that is
        narrow: without turning back it would be found, and left, in every full turn.
        """
        cfg = self.steering
        frame, direction = self.read(FRAME).value, self.held_turn.direction
        self.drop_course()
        if frame is None:
            return
        ends_rad = self.yaw_rad(state) + direction * cfg.yaw_rate_radps * cfg.turn_lag_s
        back_rad = math.remainder(frame.attitude.yaw_rad - ends_rad, 2.0 * math.pi)
        if abs(back_rad) > cfg.turn_back_rad:
            self._advancing = False
            self.start_move(yaw_rad=back_rad)

    # --- advancing or turning ---------------------------------------------------------------------

    def wander(self, state: DroneState) -> bool:
        """Advance or turn as the policy decides, in a search and in a detour.

        Args:
            state: Of the drone.

        Returns:
            Whether an advance began.
        """
        if self.flow(state) or self.moving(state):
            return False
        match self.decide():
            case Blocked(yaw_rad=yaw_rad):
                if self.turning or not self.make_room():
                    self.keep_turning(state, yaw_rad)
            case Done():  # as long as the search lasts it looks round
                if self.turning or not self.make_room():
                    self.keep_turning(state, 0.0)
            case Advance() | FollowLeg() | Rotate() if self.turning and self.turn_is_complete:
                self.turn_back(state)  # judge the view once more, then advance
            case _ if self.turning:
                self.keep_turning(state, None)
            case answer:
                return self.go_on(state, answer)
        return False

    # --- viewing ----------------------------------------------------------------------------------

    def current_view(self) -> tuple[Frame, ClassMap, CameraModel] | None:
        """Return the frame, its class map and camera when they show what lies ahead now."""
        view = current_view(self)
        return None if view is None or view[0].captured_s < self._view_from_s else view

    def decide(self) -> Answer | None:
        """Ask the policy about the present view; None while there is none."""
        view = self.current_view()
        if view is None:
            self.feedback_message = "waiting for a view"
            return None
        shown = policy_view(
            self,
            *view,
            held=self.held_turn,
            tie_break=float(self._rng.random()),
            clearances=self._clearances,
        )
        with self._timer:
            answer = ask(self._policy, shown)
        self.feedback_message = answer.reason
        return answer
