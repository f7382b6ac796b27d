"""Movers of a scene: carts and people on paths, as scene files describe them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_bridge.twin.shapes import Vector2
from uav_bt.errors import ValueRangeError
from uav_bt.lab.room import SIDE_PAPERS
from uav_bt.types.ground import Footprint

_MIN_LEG_M: Final = 0.1  # smallest distance between two corners of a path; chosen
_ROUNDING_M: Final = 1e-9  # 0.1 m between two decimal coordinates may come out a little shorter
_ROUND_CORNERS: Final = 32  # corners of the polygon around the outline of a cylinder

_Side = Annotated[float, Field(ge=0.1, le=2.5)]
_Pause = Annotated[float, Field(ge=0.0, le=60.0)]


@dataclass(frozen=True, kw_only=True)
class MoverSpec:
    """A cart or a person that follows a path at constant speed."""

    path_m: tuple[Vector2, ...]  # corners of the path, world x and y; the mover starts at the first
    speed_mps: Annotated[float, Field(ge=0.2, le=1.0)]
    shape: Literal["box", "cylinder"] = "cylinder"
    pattern: Annotated[int, Field(ge=1, le=len(SIDE_PAPERS))] = 8  # printed paper, as for a box
    size_m: tuple[_Side, _Side, _Side] = (0.4, 0.4, 1.7)  # along the mover's x and y, and upwards
    yaw_deg: float = 0.0  # counter-clockwise from +x; constant, as of a cart on castors
    loop: bool = False  # True: from the last corner to the first; False: back along the path
    pauses_s: tuple[_Pause, _Pause] | None = None  # least and most before each run of the path
    kind: str | None = None  # of the lab: in place of shape, pattern and size

    def __post_init__(self) -> None:
        if self.shape == "cylinder" and self.size_m[0] != self.size_m[1]:
            raise ValueRangeError(
                "a cylinder is as wide as it is deep: the first two numbers of its size_m must be "
                f"equal, got {list(self.size_m)}"
            )
        least_m = _MIN_LEG_M - _ROUNDING_M
        if len(self.path_m) < 2 or any(math.dist(*ends) < least_m for ends in self.legs()):
            raise ValueRangeError(
                f"a mover's path_m must have at least two corners, {_MIN_LEG_M} m apart or more, "
                f"got {[list(corner) for corner in self.path_m]}"
            )
        if self.pauses_s is not None and self.pauses_s[0] > self.pauses_s[1]:
            got = list(self.pauses_s)
            raise ValueRangeError(f"a mover's pauses_s are the least and the most, got {got}")

    def legs(self) -> Iterator[tuple[Vector2, Vector2]]:
        """Yield the straight legs of one run of the path."""
        yield from itertools.pairwise(self.path_m)
        if self.loop:
            yield self.path_m[-1], self.path_m[0]

    def footprint(self, x_m: float, y_m: float) -> Footprint:
        """Return the outline from above for a centre."""
        return Footprint(
            x_m=x_m,
            y_m=y_m,
            half_x_m=self.size_m[0] / 2,
            half_y_m=self.size_m[1] / 2,
            yaw_rad=math.radians(self.yaw_deg),
            round=self.shape == "cylinder",
        )

    @cached_property
    def swept(self) -> list[NDArray[np.float32]]:
        """The swept area: a convex polygon (N, 2) in world metres for each leg."""
        corners = np.array(self.footprint(0.0, 0.0).corners())
        if self.shape == "cylinder":
            radius_m = self.size_m[0] / 2 / math.cos(math.pi / _ROUND_CORNERS)
            turns = np.arange(_ROUND_CORNERS) * 2.0 * math.pi / _ROUND_CORNERS
            corners = np.column_stack([np.cos(turns), np.sin(turns)]) * radius_m
        ends = [(np.array(leg)[:, None] + corners).reshape(-1, 2) for leg in self.legs()]
        hulls = (cv2.convexHull(each.astype(np.float32)) for each in ends)
        return [np.asarray(hull[:, 0], dtype=np.float32) for hull in hulls]

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the least distance from a world point to the swept area; 0 inside it."""
        nearest = (cv2.pointPolygonTest(each, (x_m, y_m), measureDist=True) for each in self.swept)
        return max(0.0, -max(nearest))


def mover_names(movers: Sequence[MoverSpec]) -> tuple[str, ...]:
    """Return the names of movers in contacts and messages."""
    return tuple(f"mover-{number}" for number in range(1, len(movers) + 1))
