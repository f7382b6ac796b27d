"""Objects that stand in a scene: boxes in printed paper, and the landing box or mat."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

from sim_bridge.twin.movers import PATTERN_COUNT, roof_of
from uav_bt.errors import ValueRangeError
from uav_bt.lab.shipped import default_mark
from uav_bt.plugins import make_mark_finder
from uav_bt.types import LandingMark
from uav_bt.types.ground import Footprint

MAX_HEIGHT_M = 4.0  # leaves 1 m below the ceiling
H_SHARE: Final = 0.8  # side of the panel with the H over the side of the pad's top
MAT_M: Final = 0.002  # height of a drawn mat
_LEAST_M: Final = 0.05  # least side of an object

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]


def _check_item(what: str, position_m: Vector2, yaw_deg: float, size_m: Vector3) -> None:
    if not all(math.isfinite(value) for value in (*position_m, yaw_deg, *size_m)):
        raise ValueRangeError(f"{what}: position, yaw and size must be finite numbers")
    if min(size_m) < _LEAST_M or size_m[2] > MAX_HEIGHT_M:
        raise ValueRangeError(
            f"{what}: size_m must be at least {_LEAST_M} m each way and at most {MAX_HEIGHT_M} m "
            f"high, got {list(size_m)}"
        )


def _footprint(position_m: Vector2, yaw_deg: float, size_m: Vector3) -> Footprint:
    return Footprint(
        x_m=position_m[0],
        y_m=position_m[1],
        half_x_m=size_m[0] / 2,
        half_y_m=size_m[1] / 2,
        yaw_rad=math.radians(yaw_deg),
    )


@dataclass(frozen=True, kw_only=True)
class BoxSpec:
    """A cardboard box wrapped in printed paper, standing on the ground.

    Raises:
        ValueRangeError: a number is out of range.
    """

    pattern: int  # 1 to 8; selects texture and class of the sides and of the roof
    position_m: Vector2  # centre on the ground, world x and y
    size_m: Vector3  # along the box's x and y, and upwards
    yaw_deg: float = 0.0  # counter-clockwise from +x

    def __post_init__(self) -> None:
        if not 1 <= self.pattern <= PATTERN_COUNT:
            raise ValueRangeError(
                f"a box's pattern must be 1 to {PATTERN_COUNT}, got {self.pattern}"
            )
        _check_item(f"box {self.pattern}", self.position_m, self.yaw_deg, self.size_m)

    @cached_property
    def footprint(self) -> Footprint:
        """The outline of the box from above."""
        return _footprint(self.position_m, self.yaw_deg, self.size_m)

    @property
    def roof(self) -> int:
        """The pattern of the roof, 1 to 5."""
        return roof_of(self.pattern)


@dataclass(frozen=True, kw_only=True)
class Helipad:
    """The landing box or mat: the mark on top, yellow and red stripes on the sides.

    Raises:
        ValueRangeError: a number is out of range, or the kind refuses an option.
        UnknownNameError: the kind of mark is not registered.
    """

    position_m: Vector2  # centre on the ground, world x and y
    yaw_deg: float = 0.0  # counter-clockwise from +x
    size_m: Vector3 = field(
        default_factory=lambda: default_mark().size_m
    )  # along the pad's x and y, and upwards; a mat has the height 0
    kind: str = "helipad"  # registered name of the landing mark
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)  # of that kind

    def __post_init__(self) -> None:
        length_m, width_m, height_m = self.size_m
        if height_m < 0.0:
            raise ValueRangeError(f"helipad: the height must be 0 or more, got {height_m} m")
        solid_m = (length_m, width_m, max(height_m, _LEAST_M))
        _check_item("helipad", self.position_m, self.yaw_deg, solid_m)
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
    def drawn_size_m(self) -> Vector3:
        """The size as it is drawn: a flat mat has 2 mm, to be seen above the ground."""
        length_m, width_m, height_m = self.size_m
        return length_m, width_m, max(height_m, MAT_M)

    @property
    def panel_share(self) -> float:
        """The side of the panel with the mark over the side of the top."""
        return H_SHARE if self.kind == "helipad" else 1.0

    @cached_property
    def footprint(self) -> Footprint:
        """The outline of the pad from above."""
        return _footprint(self.position_m, self.yaw_deg, self.size_m)


def box_names(boxes: Sequence[BoxSpec]) -> tuple[str, ...]:
    """Return the names of boxes in contacts and messages: `box-3`, then `box-3-2` for a second."""
    counts: Counter[int] = Counter()
    names = []
    for box in boxes:
        counts[box.pattern] += 1
        count = counts[box.pattern]
        names.append(f"box-{box.pattern}" if count == 1 else f"box-{box.pattern}-{count}")
    return tuple(names)
