"""What the loopback ANAFI flies in: the protocol between its firmware and whatever moves the body.

The twin is one (`twin_world`); tests have a simple one of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, BodyVelocity, FlyingState, Movement, MovementStatus

__all__ = ["World", "WorldLimits", "WorldState"]


@dataclass(frozen=True, kw_only=True)
class WorldLimits:
    """What the body can do there.

    Raises:
        ValueRangeError: a limit is not positive.
    """

    max_speed_mps: float = 1.0  # m/s, horizontal
    max_climb_mps: float = 0.6  # m/s, up and down
    max_yaw_rate_radps: float = 1.4  # rad/s
    ceiling_m: float = math.inf  # m above the take-off point that the firmware keeps below

    def __post_init__(self) -> None:
        limits = (self.max_speed_mps, self.max_climb_mps, self.max_yaw_rate_radps, self.ceiling_m)
        if not all(limit > 0.0 for limit in limits):
            raise ValueRangeError(f"a world's limits must be positive, got {self}")


@dataclass(frozen=True, kw_only=True)
class WorldState:
    """What the drone's sensors say."""

    time_s: float = 0.0
    flying: FlyingState = FlyingState.LANDED
    lifting: bool = False  # whether it has left the ground; false while the motors spin up
    attitude: Attitude = field(default_factory=Attitude)  # yaw clockwise from north
    velocity: BodyVelocity = field(default_factory=BodyVelocity)
    north_m: float = 0.0  # from the world's origin
    east_m: float = 0.0
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    gimbal_pitch_rad: float = 0.0
    movement: MovementStatus | None = None


class World(Protocol):
    """Moves a body as told; may be asked and told from another thread than its own."""

    @property
    def limits(self) -> WorldLimits:
        """What the body can do."""
        ...

    def state(self) -> WorldState:
        """Return the newest state; never blocks."""
        ...

    def move(self, movement: Movement) -> None:
        """Order a movement; it replaces the one before. A `MoveBy` is told once, by its id."""
        ...

    def point(self, pitch_rad: float) -> None:
        """Turn the camera: 0 level, negative down; within -pi/2 and pi/2."""
        ...
