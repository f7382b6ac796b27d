"""Advance or turn under a leaf policy, in a search and in a detour."""

from __future__ import annotations

from behaviours.fly.steering import SteeringLeaf
from uav_bt.answers import Advance, Blocked, Done, FollowLeg, Rotate
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
    match leaf.decide():
        case Blocked(yaw_rad=yaw_rad):
            if leaf.turning or not leaf.make_room():
                leaf.keep_turning(state, yaw_rad)
        case Done():  # as long as the search lasts it looks round
            if leaf.turning or not leaf.make_room():
                leaf.keep_turning(state, 0.0)
        case Advance() | FollowLeg() | Rotate() if leaf.turning and leaf.turn_is_complete:
            leaf.turn_back(state)  # judge the view once more, then advance
        case _ if leaf.turning:
            leaf.keep_turning(state, None)
        case answer:
            return leaf.go_on(state, answer)
    return False
