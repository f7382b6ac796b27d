"""Avoid: turn away from what blocks the path until it is free."""

from __future__ import annotations

from behaviours.fly.giving_way import GIVES_WAY, GivingWay
from behaviours.fly.steering import SteeringLeaf
from uav_bt.board.context import MissionContext
from uav_bt.tree import Status
from uav_bt.types import DroneState


class Avoid(SteeringLeaf):
    """Turn away until the policy finds the path free; SUCCESS at once when it is already.

    SUCCESS, too, when a look round has left the policy nothing to do.
    """

    ports = (*SteeringLeaf.ports, GIVES_WAY)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy, and watch what moves."""
        super().on_setup(mission)
        self._giving_way = GivingWay(self)

    def initialise(self) -> None:
        """Forget the last turn."""
        self.restart_view()

    def work(self, state: DroneState) -> Status:
        """Go on turning until the policy finds the path free."""
        if self._giving_way.work() or self.moving(state):
            return Status.RUNNING
        decision = self.decide()
        if decision is not None and decision.done:
            return Status.SUCCESS
        if decision is not None and not decision.blocked and self.turn_is_complete:
            # Who flies at a speed steers by a heading, wherever the camera points.
            if not self.turning or decision.speed_mps is not None:
                return Status.SUCCESS
            self.turn_back(state)
            return Status.RUNNING
        # The turn itself takes seconds in which the drone drifts: first clear an intrusion.
        if decision is None or not self.make_room():
            self.keep_turning(state, decision)
        return Status.RUNNING
