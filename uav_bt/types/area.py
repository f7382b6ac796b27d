"""The area that a drone stays in: polygons on the ground, relative to the take-off pose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from uav_bt.errors import ValueRangeError

Point = tuple[float, float]
Edge = tuple[float, float, float, float]  # x and y of the first corner; vector to the second
Polygon = tuple[Point, ...]


@dataclass(frozen=True)
class Area:
    """The intersection of polygons, in metres ahead and to the right of the take-off pose."""

    polygons: tuple[Polygon, ...]

    def __post_init__(self) -> None:
        if not self.polygons:
            raise ValueRangeError("an area needs at least one polygon, got none")
        for polygon in self.polygons:
            _check(polygon)

    @cached_property
    def edges(self) -> tuple[tuple[Edge, ...], ...]:
        """The sides of each polygon."""
        return tuple(tuple(_edges(polygon)) for polygon in self.polygons)

    def margin_m(self, x_m: float, y_m: float) -> float:
        """Return the distance to the boundary: positive inside, negative outside."""
        return min(margin_m(edges, x_m, y_m) for edges in self.edges)


def to_edge(edge: Edge, x_m: float, y_m: float) -> Point:
    """Return the vector from a point to the nearest point of a side."""
    ax, ay, ex, ey = edge
    share = ((x_m - ax) * ex + (y_m - ay) * ey) / (ex * ex + ey * ey)
    share = min(max(share, 0.0), 1.0)
    return ax + share * ex - x_m, ay + share * ey - y_m


def _edges(polygon: Sequence[Point]) -> Iterator[Edge]:
    for (ax, ay), (bx, by) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        yield ax, ay, bx - ax, by - ay


def margin_m(edges: Sequence[Edge], x_m: float, y_m: float) -> float:
    """Return the distance of a point to the sides of a polygon: positive inside."""
    inside, nearest_m = False, math.inf
    for edge in edges:
        nearest_m = min(nearest_m, math.hypot(*to_edge(edge, x_m, y_m)))
        ax, ay, ex, ey = edge
        # A ray along x crosses the sides an odd number of times from within.
        if (ay > y_m) != (ay + ey > y_m) and x_m < ax + (y_m - ay) / ey * ex:
            inside = not inside
    return nearest_m if inside else -nearest_m


def _check(polygon: Polygon) -> None:
    corners = "; ".join(f"{x:g},{y:g}" for x, y in polygon)
    if len(polygon) < 3:
        raise ValueRangeError(f"an area needs at least three corners, got {len(polygon)}")
    edges = list(_edges(polygon))
    if any(ex == 0.0 and ey == 0.0 for _, _, ex, ey in edges):
        raise ValueRangeError(f"an area has each corner once, got {corners}")
    if any(_cross(*pair) for pair in combinations(edges, 2)):
        raise ValueRangeError(f"the sides of an area must not cross, got the corners {corners}")
    if abs(sum(ax * ey - ay * ex for ax, ay, ex, ey in edges)) < 2e-6:
        raise ValueRangeError(f"the corners of an area must not lie on one line, got {corners}")


def _cross(one: Edge, other: Edge) -> bool:
    """Return whether two sides cross within both, their ends excluded."""
    ax, ay, ex, ey = one
    bx, by, fx, fy = other
    turn = ex * fy - ey * fx
    if turn == 0.0:
        return False
    first = ((bx - ax) * fy - (by - ay) * fx) / turn
    second = ((bx - ax) * ey - (by - ay) * ex) / turn
    return 1e-9 < first < 1.0 - 1e-9 and 1e-9 < second < 1.0 - 1e-9
