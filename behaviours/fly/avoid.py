"""Avoid: turn away from an obstacle or edge until the path is free."""

from __future__ import annotations

from behaviours.fly.steering import GIVES_WAY, SteeringLeaf
from uav_bt.answers import Advance, Blocked, Done, FollowLeg, Rotate
from uav_bt.tree import Status
from uav_bt.types import DroneState


class Avoid(SteeringLeaf):
    """Turn away until the policy finds the path free; SUCCESS at once if it is free already.

    Also SUCCESS when the policy answers `Done`.
    """

    answers = (Status.SUCCESS, Status.RUNNING)
    ports = (*SteeringLeaf.ports, GIVES_WAY)

    def initialise(self) -> None:
        """Drop the last turn."""
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Turn until the policy finds the path free."""
        if self.gives_way() or self.moving(state):
            return Status.RUNNING
        answer = self.decide()
        match answer:
            case Done():
                return Status.SUCCESS
            case Advance() if self.turning and self.turn_is_complete:
                self.turn_back(state)
                return Status.RUNNING
            # Legs and rotations state a heading, so the drone need not face it first.
            case Advance() | FollowLeg() | Rotate() if self.turn_is_complete:
                return Status.SUCCESS
        # A turn takes seconds, in which the drone drifts: first step away from a near obstacle.
        if answer is None or not self.make_room():
            self.keep_turning(state, answer.yaw_rad if isinstance(answer, Blocked) else None)
        return Status.RUNNING
