"""The landing mark of a place: its kind, the size of its top, and its height above the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from uav_bt.errors import ValueRangeError

MAX_HEIGHT_M: Final = 2.0


@dataclass(frozen=True, kw_only=True)
class LandingMark:
    """Kind and size of the box or mat that carries the landing mark."""

    kind: str = "helipad"  # registered name of the plug-in that finds the mark
    length_m: float  # length of the top
    width_m: float  # width of the top
    height_m: float  # height of the top above the ground; 0 for a mark on the ground
    # Settings of that plug-in, such as the family and size of a tag
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        sides = (self.length_m, self.width_m)
        sized = all(0.0 < side_m < math.inf for side_m in sides)
        if not sized or not 0.0 <= self.height_m < MAX_HEIGHT_M:
            raise ValueRangeError(
                "a landing mark needs a positive length and width and a height from 0 to "
                f"{MAX_HEIGHT_M:g} m, got {self}"
            )

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width and height, metres."""
        return self.length_m, self.width_m, self.height_m

    @property
    def top_m(self) -> tuple[float, float]:
        """Length and width of the top, metres."""
        return self.length_m, self.width_m

    @property
    def area_m2(self) -> float:
        """Area of the top."""
        return self.length_m * self.width_m

    @property
    def radius_m(self) -> float:
        """Radius of the circle around the top."""
        return math.hypot(self.length_m, self.width_m) / 2.0
