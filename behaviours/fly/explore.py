"""Explore: advance step by step while the policy finds the path free."""

from __future__ import annotations

from behaviours.fly.steering import FLOWING, GIVES_WAY, SteeringLeaf
from uav_bt.answers import Blocked, Done
from uav_bt.board import PHASE
from uav_bt.tree import Status
from uav_bt.types import DroneState, MissionPhase


class Explore(SteeringLeaf):
    """Advance under a leaf policy; FAILURE when the path is blocked (Avoid's turn).

    SUCCESS when the policy finds nothing left to explore.
    """

    ports = (*SteeringLeaf.ports, FLOWING, GIVES_WAY)

    def initialise(self) -> None:
        """Write the mission's phase; only views captured from now on count."""
        self.write(PHASE, MissionPhase.EXPLORE)
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Continue the step in progress, or begin the next if the policy finds the path free."""
        if self.gives_way() or self.flow(state) or self.moving(state):
            return Status.RUNNING
        match self.decide():
            case Done():
                return Status.SUCCESS
            case Blocked():
                return Status.FAILURE
            case answer:
                self.go_on(state, answer)
                return Status.RUNNING
