"""The ground of a scene seen from above: its size, and the objects on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError
from uav_bt.types.pose import Pose2D


@dataclass(frozen=True, kw_only=True)
class Footprint(Pose2D):
    """A box seen from above: centre in the world, and half sizes along the box's axes."""

    half_x_m: float
    half_y_m: float
    yaw_rad: float = 0.0

    def corners(self) -> list[tuple[float, float]]:
        """Return the four corners in world metres, counter-clockwise."""
        return self.rectangle(self.half_x_m, self.half_y_m)

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a world point lies on the rectangle, including its edge."""
        reach_m = self.half_x_m + self.half_y_m
        if abs(x_m - self.x_m) > reach_m or abs(y_m - self.y_m) > reach_m:
            return False  # most points are far away, and a rotation costs more
        u, v = self.to_body(x_m, y_m)
        return abs(u) <= self.half_x_m and abs(v) <= self.half_y_m

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a world point from the rectangle; 0 on it."""
        u, v = self.to_body(x_m, y_m)
        return math.hypot(max(abs(u) - self.half_x_m, 0.0), max(abs(v) - self.half_y_m, 0.0))

    def overlaps(self, other: Footprint) -> bool:
        """Return whether two rectangles overlap (separating axes; touching does not count)."""
        ours, theirs = self.corners(), other.corners()
        for yaw in (self.yaw_rad, other.yaw_rad):
            for axis in ((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))):
                a = [axis[0] * x + axis[1] * y for x, y in ours]
                b = [axis[0] * x + axis[1] * y for x, y in theirs]
                if max(a) <= min(b) or max(b) <= min(a):
                    return False
        return True


@dataclass(frozen=True, kw_only=True)
class Standing:
    """An upright box on the ground: an obstacle or the landing box."""

    footprint: Footprint
    height_m: float
    class_id: int | None = None  # of an object that maps should show; None: not shown


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A level rectangle around the world's origin at z = 0, with its fixed objects.

    Raises:
        ValueRangeError: a size is not positive.
    """

    size_m: tuple[float, float]  # along world x and y
    standing: tuple[Standing, ...] = ()

    def __post_init__(self) -> None:
        if not min(self.size_m) > 0.0:
            raise ValueRangeError(f"the ground must have a size, got {self.size_m} m")

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a world point lies on the ground, its edge included."""
        return abs(x_m) <= self.size_m[0] / 2 and abs(y_m) <= self.size_m[1] / 2
