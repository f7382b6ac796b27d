"""Avoid: turn away from what blocks the path until it is free."""

from __future__ import annotations

from behaviours.fly.steering import GIVES_WAY, SteeringLeaf
from uav_bt.answers import Advance, Blocked, Done, FollowLeg, Rotate
from uav_bt.tree import Status
from uav_bt.types import DroneState


class Avoid(SteeringLeaf):
    """Turn away until the policy finds the path free; SUCCESS at once when it is already.

    SUCCESS, too, when a look round has left the policy nothing to do.
    """

    ports = (*SteeringLeaf.ports, GIVES_WAY)

    def initialise(self) -> None:
        """Forget the last turn."""
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Go on turning until the policy finds the path free."""
        if self.gives_way() or self.moving(state):
            return Status.RUNNING
        answer = self.decide()
        match answer:
            case Done():
                return Status.SUCCESS
            case Advance() if self.turning and self.turn_is_complete:
                self.turn_back(state)
                return Status.RUNNING
            # A leg and a rotation lead to a heading, wherever the camera points.
            case Advance() | FollowLeg() | Rotate() if self.turn_is_complete:
                return Status.SUCCESS
        # The turn itself takes seconds in which the drone drifts: first clear an intrusion.
        if answer is None or not self.make_room():
            self.keep_turning(state, answer.yaw_rad if isinstance(answer, Blocked) else None)
        return Status.RUNNING
