"""Turn under way: the angle that the drone must turn before a free view may end it."""

from __future__ import annotations

import math


class HeldRotation:
    """The turn of a steering leaf; at first none is under way."""

    def __init__(self) -> None:
        self.under_way = False
        self._left_rad = 0.0
        self._yaw_rad = math.nan

    @property
    def complete(self) -> bool:
        """True when the drone has turned by the required angle, or without a turn."""
        return self._left_rad <= 0.0

    def begin(self, angle_rad: float, *, yaw_rad: float) -> None:
        """Begin a turn.

        Args:
            angle_rad: Least angle of the turn, positive.
            yaw_rad: Heading of the drone.
        """
        self.under_way = True
        self._left_rad = angle_rad
        self._yaw_rad = yaw_rad

    def go_on(self, yaw_rad: float, direction: int) -> float:
        """Return the angle turned since the last call, radians, clockwise positive.

        Args:
            yaw_rad: Heading of the drone.
            direction: Direction of the turn: +1 clockwise, -1 counter-clockwise.
        """
        turned_rad = math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._left_rad -= direction * turned_rad
        self._yaw_rad = yaw_rad
        return turned_rad
