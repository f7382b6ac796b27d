"""Avoid: turn away from what blocks the way until it is free."""

from __future__ import annotations

import math

from behaviours.steering import SteeringLeaf
from uav_bt.protocols import Decision
from uav_bt.tree import Status

__all__ = ["Avoid", "TurnAway"]


class TurnAway:
    """A turn held in one direction until it has worked; shared with the return to base."""

    def __init__(self) -> None:
        self.direction = 0  # +1 clockwise, -1 counter-clockwise, 0 before the first decision
        self._turned_rad = 0.0

    def take(self, decision: Decision) -> float:
        """Return the next turn; after a full circle the direction is given up."""
        if self._turned_rad >= 2.0 * math.pi:
            self.direction, self._turned_rad = 0, 0.0
        self.direction = self.direction or (1 if decision.yaw_rad > 0.0 else -1)
        self._turned_rad += abs(decision.yaw_rad)
        return math.copysign(decision.yaw_rad, self.direction)


class Avoid(SteeringLeaf):
    """Turn away until the policy finds the way free; SUCCESS at once when it is."""

    def initialise(self) -> None:
        """Forget the last turn."""
        self._turn = TurnAway()
        self.turning = 0

    def update(self) -> Status:
        """Go on with a turn in progress, or look whether it has worked."""
        state = self.state()
        if state is None or self.moving(state):
            return Status.RUNNING
        decision = self.decide()
        if decision is None:
            return Status.RUNNING
        if not decision.blocked:
            return Status.SUCCESS
        yaw_rad = self._turn.take(decision)
        self.turning = self._turn.direction
        self.move(yaw_rad=yaw_rad)
        return Status.RUNNING
