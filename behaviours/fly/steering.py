"""What Explore, Avoid and ReturnToBase share: ask the policy about a view, move, wait.

An advance is only decided on a class map captured after the last movement ended, as in the paper.
A turn is held in one direction until it has worked, so that the drone does not oscillate between
two boxes, and it does not stop for each view: the drone turns while the policy judges them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from behaviours.fly.course import Course
from behaviours.fly.ground_pointing import LOOKS_DOWN, pitch_showing_ground
from behaviours.fly.keeping_away import (
    KeepAwayConfig,
    by_the_map,
    push_away_mps,
    step_away_m,
)
from behaviours.fly.movement import MovingLeaf
from behaviours.fly.mover import Progress
from behaviours.fly.turn import Turn
from behaviours.policies.view import VIEW_KEYS, ask, current_view, policy_view
from behaviours.stage_timer import StageTimer
from uav_bt.board import (
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    FRAME,
    HELD_TURN,
    OBSTACLES,
    ODOMETRY,
    PHASE,
    SITE_MAP,
    STATE,
)
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.protocols import Decision, LeafPolicy
from uav_bt.tree import Port
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, HeldTurn, Velocity

POLICY = Port("policy", str, default="segmentation", doc="leaf policy that chooses the way")
FLOWING = Port(
    "flowing", bool, default=False, doc="look ahead during a step: lengthen it, or break it off"
)


@dataclass(frozen=True, kw_only=True)
class SteeringConfig:
    """How steps and turns are flown. Distances are from the body's centre."""

    altitude_slack_m: float = 0.08  # the altimeter's noise; more is corrected with the next advance
    keep_away: KeepAwayConfig = field(default_factory=KeepAwayConfig)
    # Of a steady turn: in the 0.3 s from a frame's capture to its effect it turns by 10 degrees.
    yaw_rate_radps: float = 0.6
    turn_lag_s: float = 0.1  # for which a turn goes on after the command that ends it is sent
    turn_back_rad: float = math.radians(4)  # a smaller overshoot of a turn is left
    settle_s: float = 0.2  # the airframe swings on after a turn and would deflect a step
    interrupted_s: float = 1.0  # from an interrupted movement to the view that decides the next one
    climb_per_s: float = 0.8  # of the error in height, while it flies at a speed
    climb_mps: float = 0.25  # at most
    lengthen_m: float = 0.2  # a step under way is only replaced by one that ends so much further on


class SteeringLeaf(MovingLeaf):
    """Base of the leaves that move step by step under a leaf policy."""

    steering: ClassVar[SteeringConfig] = SteeringConfig()
    ports: ClassVar[tuple[Port[Any], ...]] = (POLICY, LOOKS_DOWN)
    reads: ClassVar[tuple[Key[Any], ...]] = (
        *(STATE, FLIGHT_HEIGHT, FLIGHT_PITCH, ODOMETRY),
        *VIEW_KEYS,
    )
    writes = (PHASE, HELD_TURN)
    resumes = False  # an interrupted step is decided anew, on what is in view then

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy.

        Raises:
            UnknownNameError: no policy has that name.
        """
        self._policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._timer = StageTimer(mission, "policy")
        self._rng: np.random.Generator = mission.rng(self.path)
        super().on_setup(mission)
        self._view_from_s = -math.inf  # frames captured earlier show another view
        self._advancing = False  # the movement under way, if any, is an advance
        self._step_ends_m = 0.0  # ahead, of the advance under way
        self._stepped_s = 0.0
        self._course = Course()
        self._turn = Turn()

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch with the port `looks_down`, None to leave it as it is."""
        flight_rad = self.read(FLIGHT_PITCH).value
        if flight_rad is None or not self.port_value(LOOKS_DOWN.name):
            return None
        return pitch_showing_ground(self, flight_rad)

    # --- advancing --------------------------------------------------------------------------------

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more)."""
        goes_on = super().moving(state)
        if not goes_on:
            wait_s = self.steering.interrupted_s if self.progress is Progress.INTERRUPTED else 0.0
            self._view_from_s = max(self._view_from_s, self._mover.ended_s + wait_s)
        return goes_on

    def move(self, state: DroneState, decision: Decision) -> None:
        """Start an advance that corrects the altitude, too.

        Args:
            state: of the drone.
            decision: how far, and in which direction.
        """
        self.write(HELD_TURN, HeldTurn())
        error_m = self._too_high_m(state)
        self._advancing = True
        self._step_ends_m = decision.forward_m
        self._stepped_s = self.clock.now()
        self.start_move(
            forward_m=decision.forward_m,
            yaw_rad=decision.yaw_rad,
            down_m=error_m if abs(error_m) > self.steering.altitude_slack_m else 0.0,
        )

    def _too_high_m(self, state: DroneState) -> float:
        """Return the error in height; where no leaf has set a flight height there is none."""
        flight_height_m = self.read(FLIGHT_HEIGHT).value
        return 0.0 if flight_height_m is None else state.height_above_carpet_m - flight_height_m

    def fly_on(self, state: DroneState, decision: Decision | None) -> None:
        """Fly ahead at a speed while the heading follows, without a stop between decisions.

        Args:
            state: of the drone.
            decision: with a speed; without a new view the last is flown on for a while.
        """
        cfg, yaw_rad = self.steering, state.attitude.yaw_rad
        if decision is not None and decision.speed_mps:
            self.write(HELD_TURN, HeldTurn())
        course = self._course.follow(decision, yaw_rad=yaw_rad, now_s=self.clock.now())
        if course is None:
            return
        speed_mps, yaw_rate = course
        if speed_mps == 0.0:
            self.propose(self.turn_keeping_away(yaw_rate))
            return
        down_mps = cfg.climb_per_s * self._too_high_m(state)
        # The heading follows the way; what pushes the drone aside on it is beside the view.
        _, right_mps = self._push_mps()
        self.propose(
            Velocity(
                forward_mps=speed_mps,
                right_mps=right_mps,
                down_mps=max(-cfg.climb_mps, min(cfg.climb_mps, down_mps)),
                yaw_rate_radps=yaw_rate,
            )
        )

    def flow(self, state: DroneState) -> bool:
        """Judge the view during a step: replace it by one that leads further, or break it off.

        Returns:
            True when that was done; False when the step goes on, or there is none.
        """
        if not (self._mover.busy and self._advancing and self.port_value("flowing")):
            return False
        now_s, motion = self.clock.now(), self.read(ODOMETRY).value
        forward_mps = (state if motion is None else motion.over_ground(state)).velocity.forward_mps
        self._step_ends_m -= forward_mps * (now_s - self._stepped_s)
        self._stepped_s = now_s
        decision, frame = self.decide(), self.read(FRAME).value
        if decision is None or frame is None:
            return False
        if decision.blocked:
            self.restart_view()
            return True
        # The decision was made for the place where the frame was captured.
        flown_m = forward_mps * (now_s - frame.captured_s)
        if decision.forward_m - flown_m < self._step_ends_m + self.steering.lengthen_m:
            return False
        self.move(state, replace(decision, forward_m=decision.forward_m - flown_m))
        return True

    def make_room(self) -> bool:
        """Start a step away from an obstacle that is too near.

        Returns:
            False when none is, or when the step would lead nearer to another.
        """
        step_m = step_away_m(self.read(OBSTACLES).value, self.steering.keep_away)
        if step_m is None:
            return False
        self._advancing = False
        self.start_move(forward_m=step_m[0], right_m=step_m[1])
        return True

    def turn_keeping_away(self, yaw_rate_radps: float) -> Velocity:
        """Return a turn on the spot that moves away from what is too near.

        A hovering drone drifts, and while it turns it may drift to where the camera does not point.
        """
        forward_mps, right_mps = self._push_mps()
        return Velocity(forward_mps=forward_mps, right_mps=right_mps, yaw_rate_radps=yaw_rate_radps)

    def _push_mps(self) -> tuple[float, float]:
        site_map, motion = self.read(SITE_MAP).value, self.read(ODOMETRY).value
        placed = None if site_map is None or motion is None else site_map.at(motion.pose)
        cfg = self.steering.keep_away
        return push_away_mps(by_the_map(self.read(OBSTACLES).value, placed, cfg), cfg)

    # --- turning ----------------------------------------------------------------------------------

    def restart_view(self) -> None:
        """Drop movement and turn, and only use views captured once the airframe has settled."""
        self._mover.drop(self.clock.now())
        self._view_from_s = self.clock.now() + self.steering.settle_s
        self._course.drop()
        self._turn = Turn()

    @property
    def turning(self) -> bool:
        """True while a turn is under way."""
        return self._turn.under_way

    @property
    def turn_is_complete(self) -> bool:
        """True when the drone has turned as far as the policy asked, or no turn is under way."""
        return self._turn.complete

    @property
    def held_turn(self) -> HeldTurn:
        """The turn held since the last advance, by whichever leaf."""
        return self.read(HELD_TURN).value or HeldTurn()

    def keep_turning(self, state: DroneState, decision: Decision | None) -> None:
        """Begin a turn as the policy decided, or go on with the one under way.

        Args:
            state: of the drone.
            decision: the policy's on the present view, if there is one.
        """
        yaw_rad, held = state.attitude.yaw_rad, self.held_turn
        if not self.turning:
            if decision is None or not decision.blocked:
                return
            self._turn.begin(abs(decision.yaw_rad), yaw_rad=yaw_rad)
        direction = held.direction
        if direction == 0 and decision is not None:
            direction = 1 if decision.yaw_rad > 0.0 else -1
        turned_rad = held.turned_rad + abs(self._turn.go_on(yaw_rad, direction))
        self.write(HELD_TURN, HeldTurn(direction=direction, turned_rad=turned_rad))
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
        self.restart_view()
        if frame is None:
            return
        ends_rad = self._yaw_rad(state) + direction * cfg.yaw_rate_radps * cfg.turn_lag_s
        back_rad = math.remainder(frame.attitude.yaw_rad - ends_rad, 2.0 * math.pi)
        if abs(back_rad) > cfg.turn_back_rad:
            self._advancing = False
            self.start_move(yaw_rad=back_rad)

    def _yaw_rad(self, state: DroneState) -> float:
        """Return telemetry's heading as it is now, as far as the odometry knows it."""
        motion = self.read(ODOMETRY).value
        return state.attitude.yaw_rad if motion is None else motion.reported_yaw_rad

    # --- viewing ----------------------------------------------------------------------------------

    def current_view(self) -> tuple[Frame, ClassMap, CameraModel] | None:
        """Return the frame, its class map and camera when they show what lies ahead now."""
        view = current_view(self)
        return None if view is None or view[0].captured_s < self._view_from_s else view

    def decide(self) -> Decision | None:
        """Ask the policy about the present view; None while there is none."""
        view = self.current_view()
        if view is None:
            self.feedback_message = "waiting for a view"
            return None
        shown = policy_view(self, *view, held=self.held_turn, tie_break=float(self._rng.random()))
        with self._timer:
            decision = ask(self._policy, shown)
        self.feedback_message = decision.reason
        return decision
