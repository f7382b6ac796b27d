"""What stands in a scene: objects of the lab's kinds, and the landing box or mat."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from sim_bridge.twin.furniture import block
from sim_bridge.twin.shapes import PRINTED, Shape, Vector2, Vector3
from uav_bt.errors import ValueRangeError
from uav_bt.lab.shipped import default_mark
from uav_bt.plugins import make_mark_finder
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.ground import Block, Footprint, Standing

H_SHARE: Final = 0.8  # side of the panel with the H over the side of the pad's top
MAT_M: Final = 0.002  # height of a drawn mat

_Side = Annotated[float, Field(ge=0.02, le=10.0)]


@dataclass(frozen=True, kw_only=True)
class ObjectSpec:
    """An object that stands on the ground."""

    kind: str  # of the lab; `box-1` to `box-8` are boxes in printed paper
    position_m: Vector2 | None = None  # centre on the ground, or place on a wall, world x and y
    yaw_deg: float = 0.0  # counter-clockwise from +x
    wall: Literal["north", "east", "south", "west"] | int | None = None  # its back is at this wall
    along_m: float = 0.0  # from the middle of that wall, to the right or up in the drawing
    size_m: tuple[_Side, _Side, _Side] | None = None  # in place of that of its kind

    def __post_init__(self) -> None:
        if (self.position_m is None) == (self.wall is None):
            raise ValueRangeError("an object needs either position_m or wall, and not both")
        if self.along_m and self.wall is None:
            raise ValueRangeError("along_m counts along a wall: add 'wall'")

    @property
    def is_printed(self) -> bool:
        """Whether it is a box in printed paper."""
        return self.kind.startswith(PRINTED)


def _pose(position_m: Vector2, yaw_deg: float) -> Pose2D:
    return Pose2D(x_m=position_m[0], y_m=position_m[1], yaw_rad=math.radians(yaw_deg))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedObject:
    """An object of a scene: its name in contacts, its shape and its place."""

    name: str
    spec: ObjectSpec
    shape: Shape
    at_wall: Pose2D | None = None  # of what belongs to a wall

    @property
    def pose(self) -> Pose2D:
        """Where it stands."""
        return self.at_wall or _pose(self.spec.position_m or (0.0, 0.0), self.spec.yaw_deg)

    @cached_property
    def standing(self) -> Standing:
        """The object on the ground."""
        return self.shape.standing(self.pose)

    @property
    def footprint(self) -> Footprint:
        """The outline of the whole from above."""
        return self.standing.footprint


def object_names(specs: Sequence[ObjectSpec]) -> list[str]:
    """Return names in contacts and messages: `drum-1`, `drum-2`; of boxes `box-3`, `box-3-2`."""
    counts: Counter[str] = Counter()
    names = []
    for spec in specs:
        counts[spec.kind] += 1
        is_first_box = spec.is_printed and counts[spec.kind] == 1
        names.append(spec.kind if is_first_box else f"{spec.kind}-{counts[spec.kind]}")
    return names


@dataclass(frozen=True, kw_only=True)
class Helipad:
    """The landing box or mat: the mark on top, yellow and red stripes on the sides."""

    position_m: Vector2  # centre on the ground, world x and y
    yaw_deg: float = 0.0  # counter-clockwise from +x
    # Along the pad's x and y, and upwards; a mat has the height 0.
    size_m: Vector3 = field(default_factory=lambda: default_mark().size_m)
    kind: str = "helipad"  # registered name of the landing mark
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)  # of that kind

    def __post_init__(self) -> None:
        if self.options or self.kind != "helipad":
            make_mark_finder(self.mark)  # refuses wrong options

    @property
    def mark(self) -> LandingMark:
        """Kind, size and options of the landing mark."""
        length_m, width_m, height_m = self.size_m
        return LandingMark(
            kind=self.kind,
            length_m=length_m,
            width_m=width_m,
            height_m=height_m,
            options=self.options,
        )

    @property
    def pose(self) -> Pose2D:
        """Where it stands."""
        return _pose(self.position_m, self.yaw_deg)

    @cached_property
    def drawn(self) -> Block:
        """The body as it is drawn: a flat mat has 2 mm, to be seen above the ground."""
        length_m, width_m, height_m = self.size_m
        return block((length_m / 2, width_m / 2), 0.0, max(height_m, MAT_M)).at(self.pose)

    @property
    def panel_share(self) -> float:
        """The side of the panel with the mark over the side of the top."""
        return H_SHARE if self.kind == "helipad" else 1.0

    @property
    def footprint(self) -> Footprint:
        """The outline of the pad from above."""
        return self.drawn.footprint

    @property
    def standing(self) -> Standing:
        """The pad on the ground; maps show it apart from obstacles."""
        return Standing(footprint=self.footprint, height_m=self.size_m[2])
