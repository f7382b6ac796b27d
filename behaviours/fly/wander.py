"""Advance or turn under a leaf policy: what a search and a detour have in common."""

from __future__ import annotations

from behaviours.fly.steering import SteeringLeaf
from uav_bt.types import DroneState


def wander(leaf: SteeringLeaf, state: DroneState) -> bool:
    """Advance or turn as the leaf's policy decides.

    Args:
        leaf: that moves.
        state: of the drone.

    Returns:
        Whether an advance began.
    """
    if leaf.flow(state) or leaf.moving(state):
        return False
    decision = leaf.decide()
    free = decision is not None and not decision.blocked
    if not leaf.turning and (decision is None or (free and decision.speed_mps is not None)):
        leaf.fly_on(state, decision)  # at a speed, for as long as views come
        return False
    if decision is not None and free and not leaf.turning:
        leaf.move(state, decision)
        return True
    if free and leaf.turn_is_complete:
        leaf.turn_back(state)  # judge the view once more, then advance
    elif leaf.turning or (decision is not None and not leaf.make_room()):
        leaf.keep_turning(state, decision)
    return False
