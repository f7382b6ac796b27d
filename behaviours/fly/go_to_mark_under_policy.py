"""GoToMarkUnderPolicy: fly to the mark while a leaf policy finds the straight way free."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from behaviours.fly.course_leaf import GIMBAL
from behaviours.fly.mark_track import (
    TRACK,
    TRACK_KEYS,
    believed_fix,
    is_at_mark,
    is_clear,
    straight_to,
)
from behaviours.fly.steering import POLICY, SteeringLeaf
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.board import HELD_TURN, PHASE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Status
from uav_bt.types import DroneState, HeldTurn, MarkFix, MissionPhase


@dataclass(frozen=True, kw_only=True)
class UnderPolicyConfig:
    """When the way is free. The numbers were chosen in flights of the student beside boxes.

    Attributes:
        before_m: The way only needs to be free up to this distance before the mark's middle.
        min_free_m: The way is blocked when less is free, unless the mark is nearer.
        judged_s: The policy's last answer is valid for this time.
        close_m: Nearer than this, a mark out of view is below it. Further away it is hidden.
        nearer_m: A stop this much nearer to the mark than the last one is at another obstacle.
        tries: Failed detours to one side before the other side is tried.
        relieved_after: Failed detours after which the policy is asked as after a full turn.
    """

    before_m: float = 0.35
    min_free_m: float = 0.3
    judged_s: float = 0.6
    close_m: float = 1.25
    nearer_m: float = 0.5
    tries: int = 4
    relieved_after: int = 2


def free_ahead_m(answer: Answer) -> float:
    """Return how far a policy finds the way free of obstacles, regardless of the ground's end."""
    match answer:
        case Advance():
            return math.inf if answer.free_m is None else max(answer.free_m, answer.forward_m)
        case Blocked():
            unknown_m = math.inf if answer.ground_ends else 0.0
            return unknown_m if answer.free_m is None else answer.free_m
        case FollowLeg() | Rotate():  # no free distance in these answers
            return math.inf
        case Done():
            return 0.0


class GoToMarkUnderPolicy(SteeringLeaf):
    """Turn to the tracked mark, and fly straight while the policy finds the way free.

    SUCCESS where the last metre begins. FAILURE when the way is blocked; `Detour` then begins in
    the direction of the held turn. The side is kept until `tries` detours have failed: a step
    further on, the policy may prefer the other side, and the drone would fly to and fro.
    """

    points = True
    config: ClassVar[UnderPolicyConfig] = UnderPolicyConfig()
    ports = (POLICY, GIMBAL)
    reads = (*SteeringLeaf.reads, *TRACK_KEYS)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy."""
        super().on_setup(mission)
        self._side = 0  # side of the detours: +1 clockwise, -1 counter-clockwise
        self._stopped_m = math.inf  # range of the mark at the last obstacle
        self._in_vain = 0

    def initialise(self) -> None:
        """Face the mark."""
        self.write(PHASE, MissionPhase.APPROACH)
        self.write(HELD_TURN, HeldTurn(relief_turns=self._relief_turns))
        self.drop_course()
        self._judged_s, self._free_m = -math.inf, 0.0

    def work(self, state: DroneState) -> Status:
        """Ask the policy about each view that faces the mark."""
        cfg, fix, now_s = self.config, believed_fix(self), self.clock.now()
        if fix is None:
            return Status.FAILURE
        if is_at_mark(fix, now_s, cfg.close_m) and is_clear(self, fix):
            self._side = 0
            return Status.SUCCESS
        answer = self.decide() if abs(fix.bearing_rad) < TRACK.ahead_rad else None
        if answer is not None:
            self._judged_s, self._free_m = now_s, free_ahead_m(answer)
            if self._free_m < min(cfg.min_free_m, fix.range_m - cfg.before_m):
                return self._blocked(fix, answer)
        judged = now_s - self._judged_s <= cfg.judged_s
        course = straight_to(fix, most_m=self._free_m if judged else 0.0)
        self.feedback_message = course.reason
        self.fly_on(state, course)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight: policies expect views at that pitch."""
        return math.radians(self.port_value("gimbal_deg"))

    def _blocked(self, fix: MarkFix, answer: Answer) -> Status:
        """Hold a turn to the side of the next detour."""
        cfg = self.config
        if self._side == 0 or fix.range_m <= self._stopped_m - cfg.nearer_m:
            left = isinstance(answer, Advance | Blocked) and answer.yaw_rad < 0.0
            self._side, self._stopped_m, self._in_vain = -1 if left else 1, fix.range_m, 0
        else:
            self._in_vain += 1
            if self._in_vain % cfg.tries == 0:
                self._side = -self._side
        held = HeldTurn(direction=self._side, relief_turns=self._relief_turns)
        self.write(HELD_TURN, held)
        return Status.FAILURE

    @property
    def _relief_turns(self) -> int:
        return 1 if self._in_vain >= self.config.relieved_after else 0
