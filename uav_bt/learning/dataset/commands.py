"""Commands as numbers that a network can learn."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types import CutMotors, Hover, Land, MoveBy, Movement, Release, TakeOff, Velocity

__all__ = ["MOVEMENT_KINDS", "kind_of", "values_of"]

_KINDS: Final[dict[type[Movement], str]] = {
    Hover: "hover",
    TakeOff: "take_off",
    Land: "land",
    MoveBy: "move_by",
    Velocity: "velocity",
    CutMotors: "cut_motors",
    Release: "release",
}
MOVEMENT_KINDS: Final = tuple(_KINDS.values())
"""The kinds of movements by number; new ones are added at the end."""


def kind_of(movement: Movement) -> int:
    """Return the number of a movement's kind."""
    return MOVEMENT_KINDS.index(_KINDS[type(movement)])


def values_of(movement: Movement) -> NDArray[np.float32]:
    """Return a movement's parts: forward, right, down, and yaw clockwise positive.

    Returns:
        (4,) metres and radians of a `MoveBy`, metres and radians a second of a `Velocity`, else 0.
    """
    match movement:
        case MoveBy():
            parts = (movement.forward_m, movement.right_m, movement.down_m, movement.yaw_rad)
        case Velocity():
            parts = (
                movement.forward_mps,
                movement.right_mps,
                movement.down_mps,
                movement.yaw_rate_radps,
            )
        case _:
            parts = (0.0, 0.0, 0.0, 0.0)
    return np.array(parts, dtype=np.float32)
