"""A turn under way: how far the drone has to turn before a free view may end it."""

from __future__ import annotations

import math


class HeldRotation:
    """The turn of a steering leaf; none is under way at first."""

    def __init__(self) -> None:
        self.under_way = False
        self._left_rad = 0.0
        self._yaw_rad = math.nan

    @property
    def complete(self) -> bool:
        """True when the drone has turned as far as was asked, or no turn is under way."""
        return self._left_rad <= 0.0

    def begin(self, angle_rad: float, *, yaw_rad: float) -> None:
        """Begin a turn.

        Args:
            angle_rad: to turn by at least, positive.
            yaw_rad: of the drone.
        """
        self.under_way = True
        self._left_rad = angle_rad
        self._yaw_rad = yaw_rad

    def go_on(self, yaw_rad: float, direction: int) -> float:
        """Return by how much the drone has turned since the last call, clockwise positive.

        Args:
            yaw_rad: of the drone.
            direction: of the turn: +1 clockwise, -1 counter-clockwise.
        """
        turned_rad = math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._left_rad -= direction * turned_rad
        self._yaw_rad = yaw_rad
        return turned_rad
