"""Boxes and cylinders that the shapes of a lab's kinds consist of.

At yaw 0 the front of a shape looks along its -y axis, down in the drawing of a scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from uav_bt.lab.room import ROUND, ObjectKind
from uav_bt.types.ground import Block, Footprint

Look = Literal["surface", "frame", "detail"]
Span = tuple[float, float]

_OVERHANG_M: Final = 0.05  # of a table's top over its legs, if it is large enough; chosen
_INSET_M: Final = 0.004  # of boards within posts and sides, so that no two faces lie in one plane
_LOWEST_SHELF_M: Final = 0.12  # upper side of a rack's lowest shelf
_BELOW_POSTS_M: Final = 0.02  # of a rack's highest shelf
_ROUND_INSET: Final = 0.16  # of the legs of a round table, over its diameter: they lie below it


@dataclass(frozen=True, kw_only=True)
class Part(Block):
    """An upright box or cylinder of an object, in the axes of the object."""

    look: Look = "surface"  # details are dark: handles, trousers
    roofed: bool = False  # its upper side has the class and look of the object's top


def parts_of(kind: ObjectKind) -> tuple[Part, ...]:
    """Return the parts of a kind; of a mesh the box around it."""
    makers = {"table": _table, "round_table": _table, "rack": _rack, "shelf": _rack}
    usual = _of_boxes if kind.shape in _BOXES else whole
    return tuple(makers.get(kind.shape, usual)(kind))


def block(
    half_m: tuple[float, float], base_m: float, top_m: float, at_m: tuple[float, float] = (0.0, 0.0)
) -> Part:
    """Return a box between two heights, by its half sizes and centre."""
    outline = Footprint(x_m=at_m[0], y_m=at_m[1], half_x_m=half_m[0], half_y_m=half_m[1])
    return Part(footprint=outline, base_m=base_m, top_m=top_m)


def whole(kind: ObjectKind) -> Iterator[Part]:
    """Yield the box or cylinder around a shape."""
    (length_m, width_m, height_m), base_m = kind.size_m, kind.above_floor_m or 0.0
    part = block((length_m / 2, width_m / 2), base_m, base_m + height_m)
    outline = replace(part.footprint, round=kind.shape in ROUND)
    yield replace(part, footprint=outline, roofed=True)


def _table(kind: ObjectKind) -> Iterator[Part]:
    below_m = kind.size_m[2] - kind.board_m
    inset_m = min(_OVERHANG_M, min(kind.size_m[:2]) / 2 - kind.post_m)
    if kind.shape in ROUND:
        inset_m = _ROUND_INSET * kind.size_m[0]
    for board in whole(kind):
        yield replace(board, base_m=below_m)
    yield from _legs(kind, inset_m, below_m)


def _rack(kind: ObjectKind) -> Iterator[Part]:
    """Yield shelves between four posts, or between sides before a back."""
    length_m, width_m, height_m = kind.size_m
    half_m = (length_m / 2 - _INSET_M, width_m / 2 - _INSET_M)
    lowest_m = max(_LOWEST_SHELF_M, kind.board_m) if kind.shelves > 1 else height_m
    tops_m = np.linspace(min(lowest_m, height_m), height_m, kind.shelves) - _BELOW_POSTS_M
    for top_m in tops_m.tolist():
        shelf = block(half_m, max(top_m - kind.board_m, 0.0), top_m)
        yield replace(shelf, roofed=top_m == tops_m[-1])
    yield from _legs(kind, 0.0, height_m) if kind.shape == "rack" else _of_boxes(kind)


def _legs(kind: ObjectKind, inset_m: float, top_m: float) -> Iterator[Part]:
    """Yield four legs at the corners, moved inwards."""
    half_m = kind.post_m / 2
    x_m, y_m = (side / 2 - inset_m - half_m for side in kind.size_m[:2])
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        leg = block((half_m, half_m), 0.0, top_m, (sx * x_m, sy * y_m))
        yield replace(leg, look="frame")


def _of_boxes(kind: ObjectKind) -> Iterator[Part]:
    length, width, height = (side_m / 100 for side_m in kind.size_m)
    base_m = kind.above_floor_m or 0.0
    for (left, right), (front, back), (low, high), look in _BOXES[kind.shape]:
        half_m = ((right - left) * length / 4, (back - front) * width / 4)
        middle_m = ((right + left) * length / 4, (back + front) * width / 4)
        part = block(half_m, base_m + low * height, base_m + high * height, middle_m)
        yield replace(part, look=look, roofed=(kind.shape, high) in _ROOFED)
    if kind.shape == "person":
        radius_m = min(22 * length, 34 * width)
        head = block((radius_m, radius_m), 86 * height, 100 * height)
        yield replace(head, look="frame", footprint=replace(head.footprint, round=True))


# Boxes in percent: along x and y of half the length and width, along z of the height.
_BOXES: Final[Mapping[str, tuple[tuple[Span, Span, Span, Look], ...]]] = {
    "chair": (
        ((-98, 98), (-98, 98), (46, 50), "surface"),
        ((-98, 98), (86, 96), (62, 99), "surface"),
        ((-100, -80), (-100, -80), (0, 46), "frame"),  # legs
        ((80, 100), (-100, -80), (0, 46), "frame"),
        ((-100, -80), (80, 100), (0, 100), "frame"),
        ((80, 100), (80, 100), (0, 100), "frame"),
    ),
    "shelf": (
        ((-100, -94), (-100, 100), (0, 100), "surface"),  # sides
        ((94, 100), (-100, 100), (0, 100), "surface"),
        ((-94, 94), (90, 100), (0, 98.5), "frame"),
        ((-94, 94), (-85, 90), (0, 3.5), "detail"),  # plinth
    ),
    "cabinet": (
        ((-96, 96), (-70, 100), (0, 7), "detail"),
        ((-100, 100), (-88, 100), (7, 100), "surface"),
        ((-1.2, 1.2), (-89, -88), (7, 97), "detail"),  # gap between its doors
        ((-20, -15), (-100, -88), (55, 72), "detail"),  # handles
        ((15, 20), (-100, -88), (55, 72), "detail"),
    ),
    "person": (
        ((-58, 58), (-60, 60), (0, 48), "detail"),  # trousers
        ((-72, 72), (-75, 75), (48, 82), "surface"),
        ((-100, -74), (-45, 45), (48, 81), "surface"),  # arms and hands
        ((74, 100), (-45, 45), (48, 81), "surface"),
        ((-98, -76), (-40, 40), (42, 48), "frame"),
        ((76, 98), (-40, 40), (42, 48), "frame"),
        ((-24, 24), (-35, 35), (82, 86), "frame"),  # neck
    ),
    "door": (
        ((-87, 87), (20, 100), (0, 95), "surface"),
        ((-100, -86), (-40, 100), (0, 100), "frame"),
        ((86, 100), (-40, 100), (0, 100), "frame"),
        ((-86, 86), (-40, 100), (94, 100), "frame"),
        ((62, 80), (-100, 20), (49.5, 51), "detail"),  # handle
    ),
    "window": (
        ((-92, 92), (40, 100), (5, 95), "surface"),
        ((-100, 100), (-100, 100), (0, 3), "frame"),  # sill
        ((-97, -90), (0, 100), (3, 100), "frame"),
        ((90, 97), (0, 100), (3, 100), "frame"),
        ((-90, 90), (0, 100), (3, 10), "frame"),
        ((-90, 90), (0, 100), (94, 100), "frame"),
        ((-3, 3), (10, 100), (10, 94), "frame"),
    ),
}
_ROOFED: Final = {("cabinet", 100), ("chair", 50)}  # and the heights of their upper faces
