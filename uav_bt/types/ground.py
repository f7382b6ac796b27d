"""The ground of a scene seen from above: its size, and the objects on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

from uav_bt.errors import ValueRangeError
from uav_bt.types.area import Area, Point
from uav_bt.types.pose import Pose2D


@dataclass(frozen=True, kw_only=True)
class Footprint(Pose2D):
    """A box or a cylinder seen from above: centre in the world, half sizes along its axes."""

    half_x_m: float  # of a cylinder: its radius
    half_y_m: float
    yaw_rad: float = 0.0
    round: bool = False  # a circle; its corners are those of the square around it

    def corners(self) -> list[tuple[float, float]]:
        """Return the four corners in world metres, counter-clockwise."""
        return self.rectangle(self.half_x_m, self.half_y_m)

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a world point lies on the outline's inside, including its edge."""
        reach_m = self.half_x_m + self.half_y_m
        if abs(x_m - self.x_m) > reach_m or abs(y_m - self.y_m) > reach_m:
            return False  # most points are far away, and a rotation costs more
        if self.round:
            return math.hypot(x_m - self.x_m, y_m - self.y_m) <= self.half_x_m
        u, v = self.to_body(x_m, y_m)
        return abs(u) <= self.half_x_m and abs(v) <= self.half_y_m

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a world point from the outline; 0 inside."""
        if self.round:
            return max(0.0, math.hypot(x_m - self.x_m, y_m - self.y_m) - self.half_x_m)
        u, v = self.to_body(x_m, y_m)
        return math.hypot(max(abs(u) - self.half_x_m, 0.0), max(abs(v) - self.half_y_m, 0.0))

    def overlaps(self, other: Footprint) -> bool:
        """Return whether two outlines overlap (separating axes; touching does not count)."""
        if self.round:
            return other.distance_m(self.x_m, self.y_m) < self.half_x_m
        if other.round:
            return other.overlaps(self)
        ours, theirs = self.corners(), other.corners()
        for yaw in (self.yaw_rad, other.yaw_rad):
            for axis in ((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))):
                a = [axis[0] * x + axis[1] * y for x, y in ours]
                b = [axis[0] * x + axis[1] * y for x, y in theirs]
                if max(a) <= min(b) or max(b) <= min(a):
                    return False
        return True


@dataclass(frozen=True, kw_only=True)
class Block:
    """A part of an object: an outline from one height above the ground to another."""

    footprint: Footprint
    base_m: float
    top_m: float

    def at(self, pose: Pose2D) -> Self:
        """Return a part, given in the axes of an object, where the object stands."""
        placed = pose.pose_to_world(self.footprint)
        return replace(self, footprint=replace(self.footprint, **vars(placed)))


@dataclass(frozen=True, kw_only=True)
class Standing:
    """An upright object on the ground: an obstacle or the landing box."""

    footprint: Footprint  # of the whole
    height_m: float
    class_id: int | None = None  # of an object that maps should show; None: not shown
    parts: tuple[Block, ...] = ()  # such as the legs and the top of a table; none: it is solid

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The parts, or the whole from the ground to its height."""
        return self.parts or (Block(footprint=self.footprint, base_m=0.0, top_m=self.height_m),)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A level rectangle around the world's origin, or a polygon in it, with its objects."""

    size_m: tuple[float, float]  # along world x and y
    standing: tuple[Standing, ...] = ()
    outline_m: tuple[Point, ...] = ()  # corners of a polygon in that rectangle; none: the rectangle

    def __post_init__(self) -> None:
        if not min(self.size_m) > 0.0:
            raise ValueRangeError(f"the ground must have a size, got {self.size_m} m")

    @cached_property
    def corners_m(self) -> tuple[Point, ...]:
        """The corners of the outline in order, world x and y."""
        half_x, half_y = (side / 2 for side in self.size_m)
        rectangle = ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
        return self.outline_m or rectangle

    @cached_property
    def area(self) -> Area:
        """The outline as an area of the world."""
        return Area((self.corners_m,))

    def contains(self, x_m: float, y_m: float) -> bool:
        """Return whether a world point lies on the ground, its edge included."""
        inside = abs(x_m) <= self.size_m[0] / 2 and abs(y_m) <= self.size_m[1] / 2
        return inside and (not self.outline_m or self.area.margin_m(x_m, y_m) >= 0.0)

    def margin_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a world point to the ground's edge: positive inside."""
        return self.area.margin_m(x_m, y_m)
