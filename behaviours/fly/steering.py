"""What exploring, avoiding and returning share: look, ask the policy, move, wait for the move.

An advance is only decided on a class map captured after the last movement ended, as in the paper.
A turn is held in one direction until it has worked, so that two boxes never make the drone dither,
and it does not stop at every look: the drone turns steadily while the policy judges each new view.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from behaviours.fly.movement import MovingLeaf
from behaviours.policies.view import VIEW_KEYS, current_view, policy_view
from uav_bt.board import FLIGHT_HEIGHT, FRAME, HELD_TURN, OBSTACLES, PHASE, STATE
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.protocols import Decision, LeafPolicy
from uav_bt.tree import Port
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, HeldTurn, Velocity

POLICY = Port("policy", str, default="segmentation", doc="leaf policy that chooses the way")
FLOWING = Port(
    "flowing", bool, default=False, doc="look ahead during a step: lengthen it, or break it off"
)

# Less than this is the altimeter's noise; more is corrected with the next advance.
_ALTITUDE_SLACK_M = 0.08
# An obstacle this near to the body's centre, half of whose diagonal is 0.2 m, is an intrusion.
_TOO_NEAR_M = 0.38
_ROOM_STEP_M = 0.15
# While it turns the drone draws away, so fast, from obstacles nearer than this, and from the
# carpet's edge, which may be nearer by so much.
_KEEP_AWAY_M = 0.45
_EDGE_NEARER_M = 0.15
_KEEP_AWAY_MPS = 0.08
# A steady turn: between a frame's capture and its effect, 0.3 s, it goes on by 10 degrees.
_YAW_RATE_RADPS = 0.6
# So long a turn goes on until the drone hears that it is to end.
_TURN_LAG_S = 0.1
# Turned too far by less than this, it stays where it is.
_TURN_BACK_RAD = math.radians(4)
# After a turn the airframe swings on for this long; a step begun earlier would go astray.
_SETTLE_S = 0.2
# A step under way is only replaced by one that ends this much further on.
_FURTHER_M = 0.2


class SteeringLeaf(MovingLeaf):
    """Base of the leaves that move step by step under a leaf policy."""

    ports: ClassVar[tuple[Port[Any], ...]] = (POLICY,)
    reads: ClassVar[tuple[Key[Any], ...]] = (STATE, FLIGHT_HEIGHT, *VIEW_KEYS)
    writes = (PHASE, HELD_TURN)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; raises UnknownNameError for a name that nobody registered."""
        self._policy: LeafPolicy = mission.policy(self.port_value("policy"))
        self._rng: np.random.Generator = mission.rng(self.path)
        super().on_setup(mission)
        self._view_from_s = -math.inf  # frames captured earlier show another view
        self._advancing = False  # the movement under way, if any, is an advance
        self._step_ends_m = 0.0  # ahead, of the advance under way
        self._stepped_s = 0.0
        self._forget_turn()

    def state(self) -> DroneState | None:
        """Return the drone's state, None when telemetry is stale."""
        return self.read(STATE).value

    # --- advancing --------------------------------------------------------------------------------

    def moving(self, state: DroneState) -> bool:
        """Propose the movement in progress again; False when there is none (any more)."""
        goes_on = super().moving(state)
        if not goes_on:
            self._view_from_s = max(self._view_from_s, self._mover.ended_s)
        return goes_on

    def move(self, state: DroneState, decision: Decision) -> None:
        """Start an advance, correcting the altitude on the way."""
        self.write(HELD_TURN, HeldTurn())
        flight_height_m = self.read(FLIGHT_HEIGHT).value
        # Where no leaf has set a flight height, the drone keeps the height it has.
        error_m = 0.0 if flight_height_m is None else state.height_above_carpet_m - flight_height_m
        self._advancing = True
        self._step_ends_m = decision.forward_m
        self._stepped_s = self.clock.now()
        self.start_move(
            forward_m=decision.forward_m,
            yaw_rad=decision.yaw_rad,
            down_m=error_m if abs(error_m) > _ALTITUDE_SLACK_M else 0.0,
        )

    def flow(self, state: DroneState) -> bool:
        """Look ahead during a step: replace it by one that leads further, or break it off.

        Returns:
            True when that was done; False when the step goes on, or there is none.
        """
        if not (self._mover.busy and self._advancing and self.port_value("flowing")):
            return False
        now_s = self.clock.now()
        self._step_ends_m -= state.velocity.forward_mps * (now_s - self._stepped_s)
        self._stepped_s = now_s
        decision, frame = self.decide(), self.read(FRAME).value
        if decision is None or frame is None:
            return False
        if decision.blocked:
            self.look_afresh()
            return True
        # The decision was made for the place where the frame was captured.
        flown_m = state.velocity.forward_mps * (now_s - frame.captured_s)
        if decision.forward_m - flown_m < self._step_ends_m + _FURTHER_M:
            return False
        self.move(state, replace(decision, forward_m=decision.forward_m - flown_m))
        return True

    def make_room(self) -> bool:
        """Start a step away from an obstacle that is too near; False when there is no need.

        Or no way: the step must lead away from everything remembered.
        """
        obstacles = self.read(OBSTACLES).value
        if obstacles is None or obstacles.nearest_m >= _TOO_NEAR_M:
            return False
        distances = np.hypot(obstacles.points_m[:, 0], obstacles.points_m[:, 1])
        forward_m, right_m = obstacles.points_m[distances.argmin()]
        away = -_ROOM_STEP_M / max(obstacles.nearest_m, 0.05)
        forward_m, right_m = float(away * forward_m), float(away * right_m)
        if not obstacles.allows(forward_m, right_m, margin_m=_TOO_NEAR_M):
            return False
        self._advancing = False
        self.start_move(forward_m=forward_m, right_m=right_m)
        return True

    def turn_keeping_away(self, yaw_rate_radps: float) -> Velocity:
        """Return a turn on the spot that draws away from what is too near.

        A hovering drone drifts, and while it turns it may drift to where it does not look.
        """
        obstacles = self.read(OBSTACLES).value
        turn = Velocity(yaw_rate_radps=yaw_rate_radps)
        if obstacles is None:
            return turn
        points_m = np.vstack([obstacles.points_m, obstacles.edges_m])
        ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), 0.05)
        room_m = ranges_m.copy()
        room_m[len(obstacles.points_m) :] += _EDGE_NEARER_M
        # The nearer a point the more it counts; between two obstacles it stays in the middle.
        weights = np.clip(_KEEP_AWAY_M / room_m - 1.0, 0.0, None)
        if not weights.any():
            return turn
        push = -_KEEP_AWAY_MPS * (weights / ranges_m) @ points_m / weights.sum()
        return replace(turn, forward_mps=float(push[0]), right_mps=float(push[1]))

    # --- turning ----------------------------------------------------------------------------------

    def look_afresh(self) -> None:
        """Only count what is seen once the airframe has settled; no turn is under way."""
        self._mover.drop(self.clock.now())
        self._view_from_s = self.clock.now() + _SETTLE_S
        self._forget_turn()

    def _forget_turn(self) -> None:
        self._turning = False
        self._to_turn_rad = 0.0  # the least it must turn before a free way counts
        self._last_yaw_rad = math.nan

    @property
    def turning(self) -> bool:
        """True while a turn is under way."""
        return self._turning

    @property
    def turn_is_complete(self) -> bool:
        """True when the drone has turned as far as the policy asked, or no turn is under way."""
        return self._to_turn_rad <= 0.0

    @property
    def held_turn(self) -> HeldTurn:
        """The turn held since the last advance, by whichever leaf."""
        return self.read(HELD_TURN).value or HeldTurn()

    def keep_turning(self, state: DroneState, decision: Decision | None) -> None:
        """Begin a turn as the policy decided, or go on with the one under way."""
        yaw_rad, held = state.attitude.yaw_rad, self.held_turn
        if not self._turning:
            if decision is None or not decision.blocked:
                return
            self._turning = True
            self._to_turn_rad = abs(decision.yaw_rad)
            self._last_yaw_rad = yaw_rad
        direction = held.direction
        if direction == 0 and decision is not None:
            direction = 1 if decision.yaw_rad > 0.0 else -1
        turned_rad = math.remainder(yaw_rad - self._last_yaw_rad, 2.0 * math.pi)
        self._to_turn_rad -= direction * turned_rad
        self._last_yaw_rad = yaw_rad
        self.write(
            HELD_TURN,
            HeldTurn(direction=direction, turned_rad=held.turned_rad + abs(turned_rad)),
        )
        # What is seen while turning counts at once: the turn goes the same way for any of it.
        self._view_from_s = -math.inf
        self.propose(self.turn_keeping_away(direction * _YAW_RATE_RADPS))

    def turn_back(self, state: DroneState) -> None:
        """End a turn where the way was seen free; look again from there.

        A steady turn has gone on since the frame was captured. Where the free way is narrow, that
        is past it: without turning back it would be seen, and lost, on every round.
        """
        frame, direction = self.read(FRAME).value, self.held_turn.direction
        self.look_afresh()
        if frame is None:
            return
        ends_rad = state.attitude.yaw_rad + direction * _YAW_RATE_RADPS * _TURN_LAG_S
        back_rad = math.remainder(frame.attitude.yaw_rad - ends_rad, 2.0 * math.pi)
        if abs(back_rad) > _TURN_BACK_RAD:
            self._advancing = False
            self.start_move(yaw_rad=back_rad)

    # --- looking ----------------------------------------------------------------------------------

    def current_view(self) -> tuple[Frame, ClassMap, CameraModel] | None:
        """Return the frame, its class map and camera when they show what lies ahead *now*."""
        view = current_view(self)
        return None if view is None or view[0].captured_s < self._view_from_s else view

    def decide(self) -> Decision | None:
        """Ask the policy about the present view; None while there is no view of it."""
        view = self.current_view()
        if view is None:
            self.feedback_message = "waiting for a view"
            return None
        decision = self._policy.decide(
            policy_view(self, *view, held=self.held_turn, tie_break=float(self._rng.random()))
        )
        self.feedback_message = decision.reason
        return decision
