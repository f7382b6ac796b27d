"""Upright things seen from above: rotated rectangles, their overlaps and distances."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.types import Pose2D

Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Footprint(Pose2D):
    """A rectangle on the ground: its centre in the world, and half sizes along its own axes."""

    half_x_m: float
    half_y_m: float
    yaw_rad: float = 0.0

    def corners(self) -> list[Point]:
        """Return the four corners in world metres, counter-clockwise."""
        return self.rectangle(self.half_x_m, self.half_y_m)

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a world point lies on the rectangle, its edge included."""
        u, v = self.to_body(x_m, y_m)
        return abs(u) <= self.half_x_m and abs(v) <= self.half_y_m

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return how far a world point is from the rectangle; 0 on it."""
        u, v = self.to_body(x_m, y_m)
        return math.hypot(max(abs(u) - self.half_x_m, 0.0), max(abs(v) - self.half_y_m, 0.0))

    def overlaps(self, other: Footprint) -> bool:
        """Return whether two rectangles share an area (separating axes; touching is no overlap)."""
        ours, theirs = self.corners(), other.corners()
        for yaw in (self.yaw_rad, other.yaw_rad):
            for axis in ((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))):
                a = [axis[0] * x + axis[1] * y for x, y in ours]
                b = [axis[0] * x + axis[1] * y for x, y in theirs]
                if max(a) <= min(b) or max(b) <= min(a):
                    return False
        return True
