"""Explore: advance step by step for as long as the policy finds the way free."""

from __future__ import annotations

from behaviours.fly.steering import FLOWING, SteeringLeaf
from uav_bt.board import PHASE
from uav_bt.tree import Status
from uav_bt.types import MissionPhase


class Explore(SteeringLeaf):
    """Advance under a leaf policy; FAILURE when the way is blocked (Avoid's turn)."""

    ports = (*SteeringLeaf.ports, FLOWING)

    def initialise(self) -> None:
        """Say what the mission is doing; only what is seen from now on counts."""
        self.write(PHASE, MissionPhase.EXPLORE)
        self.look_afresh()

    def update(self) -> Status:
        """Go on with a step in progress, or look and begin the next."""
        state = self.state()
        if state is None or self.flow(state) or self.moving(state):
            return Status.RUNNING
        decision = self.decide()
        if decision is None:
            return Status.RUNNING
        if decision.blocked:
            return Status.FAILURE
        self.move(state, decision)
        return Status.RUNNING
