"""Movers of a scene: carts and people on paths, and their positions over time."""

from __future__ import annotations

import bisect
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

from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.shapes import Vector2
from uav_bt.errors import ValueRangeError
from uav_bt.lab.surface import SIDE_PAPERS
from uav_bt.types import MoverState, Pose
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


class Route:
    """Motion of one mover over time: runs of its path, each after a pause if pauses are given."""

    def __init__(self, spec: MoverSpec, name: str, seed: int, number: int) -> None:
        self._spec = spec
        self._name = name
        self._random = np.random.default_rng(child_seed(seed, 9, number))
        self._legs = list(spec.legs())
        # Path length from the start of a run to the end of each leg, m.
        self._ends_m = list(itertools.accumulate(math.dist(*ends) for ends in self._legs))
        self._way_s = self._ends_m[-1] / spec.speed_mps
        self._starts_s = [self._pause_s()]  # start time of each run until now

    def _pause_s(self) -> float:
        return float(self._random.uniform(*self._spec.pauses_s)) if self._spec.pauses_s else 0.0

    def at(self, time_s: float) -> MoverState:
        """Return the position and velocity at a time since the start of the simulation, s."""
        starts = self._starts_s
        while starts[-1] + self._way_s <= time_s:
            starts.append(starts[-1] + self._way_s + self._pause_s())
        way = max(bisect.bisect_right(starts, time_s) - 1, 0)
        spent_s = time_s - starts[way]
        moves = 0.0 <= spent_s < self._way_s
        along_m = min(max(spent_s, 0.0) * self._spec.speed_mps, self._ends_m[-1])
        back = not self._spec.loop and way % 2 == 1
        if back:
            along_m = self._ends_m[-1] - along_m
        leg = min(bisect.bisect_right(self._ends_m, along_m), len(self._legs) - 1)
        (x, y), (end_x, end_y) = self._legs[leg]
        length_m = math.dist((x, y), (end_x, end_y))
        ux, uy = (end_x - x) / length_m, (end_y - y) / length_m
        rest_m = along_m - (self._ends_m[leg] - length_m)
        speed = self._spec.speed_mps * (-1.0 if back else 1.0) if moves else 0.0
        return MoverState(
            name=self._name,
            pose=Pose(
                x_m=x + rest_m * ux,
                y_m=y + rest_m * uy,
                z_m=self._spec.size_m[2] / 2,
                yaw_rad=math.radians(self._spec.yaw_deg),
            ),
            vx_mps=speed * ux,
            vy_mps=speed * uy,
        )


class Traffic:
    """All movers of a scene over time, reproducible: the seed of a flight draws their pauses."""

    def __init__(self, movers: Sequence[MoverSpec], seed: int) -> None:
        self._routes = [
            Route(spec, name, seed, number)
            for number, (spec, name) in enumerate(zip(movers, mover_names(movers), strict=True))
        ]

    def at(self, time_s: float) -> tuple[MoverState, ...]:
        """Return the states of all movers at a time since the start of the simulation, s."""
        return tuple(route.at(time_s) for route in self._routes)
