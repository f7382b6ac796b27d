"""The landing mark's size: the top that carries the mark, and its height above the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class LandingMark:
    """Size of the box or mat that carries the landing mark.

    The defaults are the landing box of the paper's lab.

    Attributes:
        length_m: Length of the top, metres.
        width_m: Width of the top, metres.
        height_m: Height of the top above the ground, metres; 0 for a mark on the ground.

    Raises:
        ValueRangeError: length or width is not positive, or the height is negative.
    """

    length_m: float = 0.5
    width_m: float = 0.5
    height_m: float = 0.4

    def __post_init__(self) -> None:
        sides = (self.length_m, self.width_m)
        if not all(0.0 < side_m < math.inf for side_m in sides) or not 0.0 <= self.height_m < 2.0:
            raise ValueRangeError(
                "a landing mark needs a positive length and width and a height from 0 to 2 m, "
                f"got {self}"
            )

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width and height, metres."""
        return self.length_m, self.width_m, self.height_m

    @property
    def area_m2(self) -> float:
        """Area of the top."""
        return self.length_m * self.width_m

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the top."""
        return math.hypot(self.length_m, self.width_m) / 2.0
