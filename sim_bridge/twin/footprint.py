"""Upright things seen from above: rotated rectangles, their overlaps and distances."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Footprint"]

Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Footprint:
    """A rectangle on the ground: centre and half sizes in metres, yaw counter-clockwise."""

    x_m: float
    y_m: float
    half_x_m: float
    half_y_m: float
    yaw_rad: float = 0.0

    def to_local(self, x_m: float, y_m: float) -> Point:
        """Return a world point in the rectangle's own axes."""
        dx, dy = x_m - self.x_m, y_m - self.y_m
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return c * dx + s * dy, c * dy - s * dx

    def corners(self) -> tuple[Point, Point, Point, Point]:
        """Return the four corners in world metres, counter-clockwise."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)

        def corner(u: float, v: float) -> Point:
            return self.x_m + c * u - s * v, self.y_m + s * u + c * v

        a, b = self.half_x_m, self.half_y_m
        return corner(a, b), corner(-a, b), corner(-a, -b), corner(a, -b)

    def contains(self, x_m: float, y_m: float) -> bool:
        """Tell whether a world point lies on the rectangle, its edge included."""
        u, v = self.to_local(x_m, y_m)
        return abs(u) <= self.half_x_m and abs(v) <= self.half_y_m

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return how far a world point is from the rectangle; 0 on it."""
        u, v = self.to_local(x_m, y_m)
        return math.hypot(max(abs(u) - self.half_x_m, 0.0), max(abs(v) - self.half_y_m, 0.0))

    def overlaps(self, other: Footprint) -> bool:
        """Tell whether two rectangles share an area (separating axes; touching is no overlap)."""
        ours, theirs = self.corners(), other.corners()
        for yaw in (self.yaw_rad, other.yaw_rad):
            for axis in ((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))):
                a = [axis[0] * x + axis[1] * y for x, y in ours]
                b = [axis[0] * x + axis[1] * y for x, y in theirs]
                if max(a) <= min(b) or max(b) <= min(a):
                    return False
        return True
