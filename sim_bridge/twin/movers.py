"""Movers of a scene: carts and people on paths, as scene files describe them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.types.ground import Footprint, Ground

Point = tuple[float, float]

PATTERN_COUNT = 8  # printed papers of sides
_ROOF_COUNT = 5  # printed papers of roofs

KEPT_FREE_M = 0.25  # least distance from the take-off point to boxes and movers
_SPEEDS_MPS = (0.2, 1.0)
_SIZES_M = (0.1, 2.5)
_MIN_LEG_M = 0.1  # smallest distance between two corners of a path; chosen
_ROUNDING_M = 1e-9  # 0.1 m between two decimal coordinates may come out a little shorter
_ROUND_CORNERS = 32  # corners of the polygon around the outline of a cylinder
_LONGEST_PAUSE_S = 60.0


def roof_of(pattern: int) -> int:
    """Return the roof pattern, 1 to 5, that belongs to a side pattern."""
    return (pattern - 1) % _ROOF_COUNT + 1


@dataclass(frozen=True, kw_only=True)
class MoverSpec:
    """A cart or a person in printed paper that follows a path at constant speed.

    Raises:
        ValueRangeError: a number is out of range.
    """

    path_m: tuple[Point, ...]  # corners of the path, world x and y; the mover starts at the first
    speed_mps: float  # 0.2 to 1
    shape: Literal["box", "cylinder"] = "cylinder"
    pattern: int = 8  # 1 to 8; selects texture and class, as for a box
    size_m: tuple[float, float, float] = (0.4, 0.4, 1.7)  # along the mover's x and y, and upwards
    yaw_deg: float = 0.0  # counter-clockwise from +x; constant, as of a cart on castors
    loop: bool = False  # True: from the last corner to the first; False: back along the path
    pauses_s: Point | None = None  # shortest and longest pause before each run of the path
    kind: str | None = None  # of the lab: in place of shape, pattern and size

    def __post_init__(self) -> None:
        if not 1 <= self.pattern <= PATTERN_COUNT:
            raise ValueRangeError(
                f"a mover's pattern must be 1 to {PATTERN_COUNT}, got {self.pattern}"
            )
        low, high = _SPEEDS_MPS
        if not low <= self.speed_mps <= high:
            raise ValueRangeError(
                f"a mover's speed_mps must be {low} to {high}, got {self.speed_mps}"
            )
        low, high = _SIZES_M
        if not all(low <= side <= high for side in self.size_m):
            raise ValueRangeError(
                f"a mover's size_m must be {low} to {high} m each way, got {list(self.size_m)}"
            )
        if self.shape == "cylinder" and self.size_m[0] != self.size_m[1]:
            raise ValueRangeError(
                "a cylinder is as wide as it is deep: the first two numbers of its size_m must be "
                f"equal, got {list(self.size_m)}"
            )
        if not all(map(math.isfinite, (self.yaw_deg, *itertools.chain(*self.path_m)))):
            raise ValueRangeError("a mover's path and yaw must be finite numbers")
        min_leg_m = _MIN_LEG_M - _ROUNDING_M
        if any(math.dist(*ends) < min_leg_m for ends in self.legs()) or len(self.path_m) < 2:
            raise ValueRangeError(
                f"a mover's path_m must have at least two corners, {_MIN_LEG_M} m apart or more, "
                f"got {[list(corner) for corner in self.path_m]}"
            )
        self._check_pauses()

    def _check_pauses(self) -> None:
        if self.pauses_s is not None:
            least, most = self.pauses_s
            if not 0.0 <= least <= most <= _LONGEST_PAUSE_S:
                raise ValueRangeError(
                    "a mover's pauses_s are the least and the most, 0 to "
                    f"{_LONGEST_PAUSE_S:g} s, got {list(self.pauses_s)}"
                )

    def legs(self) -> Iterator[tuple[Point, Point]]:
        """Yield the straight legs of one run of the path."""
        yield from itertools.pairwise(self.path_m)
        if self.loop:
            yield self.path_m[-1], self.path_m[0]

    def footprint(self, x_m: float, y_m: float) -> Footprint:
        """Return the outline from above for a centre; of a cylinder, the square around it."""
        return Footprint(
            x_m=x_m,
            y_m=y_m,
            half_x_m=self.size_m[0] / 2,
            half_y_m=self.size_m[1] / 2,
            yaw_rad=math.radians(self.yaw_deg),
        )

    def covers(self, place: Point, at: Point) -> bool:
        """Return whether the mover, with its centre at `place`, covers the world point `at`."""
        if self.shape == "cylinder":
            return math.dist(place, at) <= self.size_m[0] / 2
        return self.footprint(*place).contains(*at)

    def swept(self) -> list[NDArray[np.float32]]:
        """Return the swept area: a convex polygon (N, 2) in world metres for each leg."""
        outline = np.array(self._outline())
        return [_hull(np.vstack([outline + start, outline + end])) for start, end in self.legs()]

    def _outline(self) -> list[Point]:
        if self.shape == "box":
            return self.footprint(0.0, 0.0).corners()
        radius = self.size_m[0] / 2 / math.cos(math.pi / _ROUND_CORNERS)
        turns = (2.0 * math.pi * k / _ROUND_CORNERS for k in range(_ROUND_CORNERS))
        return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the least distance from a world point to the swept area; 0 inside it."""
        nearest = (
            -cv2.pointPolygonTest(polygon, (x_m, y_m), measureDist=True) for polygon in self.swept()
        )
        return max(0.0, min(nearest))


def _hull(points: NDArray[np.float64]) -> NDArray[np.float32]:
    hull = cv2.convexHull(points.astype(np.float32))
    return np.asarray(hull[:, 0], dtype=np.float32)


def mover_problem(
    mover: MoverSpec, ground: Ground, names: Sequence[str], take_off_m: Point | None
) -> str | None:
    """Return the reason why a mover cannot follow its path; None if it can.

    Args:
        mover: the mover.
        ground: the ground with the objects on it.
        names: names of these objects, in the same order.
        take_off_m: take-off point, world x and y; None if it is random or the mark.
    """
    for x, y in mover.path_m:
        if not ground.contains(x, y):
            return f"its path leaves the ground at {_text((x, y))}"
    for item, name in zip(ground.standing, names, strict=True):
        corners = np.array(item.footprint.corners(), dtype=np.float32)
        for (start, end), polygon in zip(mover.legs(), mover.swept(), strict=True):
            if cv2.intersectConvexConvex(polygon, corners)[0] > 1e-6:
                return f"its path leads through {name} from {_text(start)} to {_text(end)}"
    if take_off_m is not None and mover.distance_m(*take_off_m) < KEPT_FREE_M:
        return f"its path comes within {KEPT_FREE_M} m of the take-off place {_text(take_off_m)}"
    return None


def _text(place: Point) -> str:
    return f"[{place[0]:g}, {place[1]:g}]"


def mover_names(movers: Sequence[MoverSpec]) -> tuple[str, ...]:
    """Return the names of movers in contacts and messages."""
    return tuple(f"mover-{number}" for number in range(1, len(movers) + 1))
