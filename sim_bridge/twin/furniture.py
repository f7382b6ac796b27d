"""Boxes and cylinders that the shapes of a lab's kinds consist of.

At yaw 0 the front of a shape looks along its -y axis, down in the drawing of a scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
_WINDOW_M: Final = 0.9  # height of a window's lower edge


@dataclass(frozen=True, kw_only=True)
class Part(Block):
    """An upright box or cylinder of an object, in the axes of the object."""

    look: Look = "surface"  # details are dark: handles, trousers
    roofed: bool = False  # its upper side has the class and look of the object's top


def parts_of(kind: ObjectKind) -> tuple[Part, ...]:
    """Return the parts of a kind; of a mesh the box around it."""
    return tuple(_MAKERS.get(kind.shape, whole)(kind))


def block(
    half_m: tuple[float, float], base_m: float, top_m: float, at_m: tuple[float, float] = (0.0, 0.0)
) -> Part:
    """Return a box between two heights, by its half sizes and centre."""
    outline = Footprint(x_m=at_m[0], y_m=at_m[1], half_x_m=half_m[0], half_y_m=half_m[1])
    return Part(footprint=outline, base_m=base_m, top_m=top_m)


def whole(kind: ObjectKind) -> Iterator[Part]:
    """Yield the box or cylinder around a shape."""
    length_m, width_m, height_m = kind.size_m
    base_m = _above_floor_m(kind)
    part = block((length_m / 2, width_m / 2), base_m, base_m + height_m)
    outline = replace(part.footprint, round=kind.shape in ROUND)
    yield replace(part, footprint=outline, roofed=True)


def _above_floor_m(kind: ObjectKind) -> float:
    usual_m = _WINDOW_M if kind.shape == "window" else 0.0
    return usual_m if kind.above_floor_m is None else kind.above_floor_m


def _box(x_m: Span, y_m: Span, z_m: Span, look: Look = "surface") -> Part:
    """Return a box between two places along each axis."""
    (left, right), (front, back) = x_m, y_m
    half_m = ((right - left) / 2, (back - front) / 2)
    return replace(block(half_m, *z_m, ((left + right) / 2, (front + back) / 2)), look=look)


def _table(kind: ObjectKind) -> Iterator[Part]:
    below_m = kind.size_m[2] - kind.board_m
    inset_m = min(_OVERHANG_M, min(kind.size_m[:2]) / 2 - kind.post_m)
    if kind.shape in ROUND:
        inset_m = _ROUND_INSET * kind.size_m[0]
    for board in whole(kind):
        yield replace(board, base_m=below_m)
    yield from _legs(kind, inset_m, below_m, below_m)


def _rack(kind: ObjectKind) -> Iterator[Part]:
    length_m, width_m, height_m = kind.size_m
    half_m = (length_m / 2 - _INSET_M, width_m / 2 - _INSET_M)
    lowest_m = max(_LOWEST_SHELF_M, kind.board_m) if kind.shelves > 1 else height_m
    tops_m = np.linspace(min(lowest_m, height_m), height_m, kind.shelves) - _BELOW_POSTS_M
    for top_m in tops_m.tolist():
        shelf = block(half_m, max(top_m - kind.board_m, 0.0), top_m)
        yield replace(shelf, roofed=top_m == tops_m[-1])
    yield from _legs(kind, 0.0, height_m, height_m)


def _chair(kind: ObjectKind) -> Iterator[Part]:
    """Yield a seat at half of the height, and a back between the longer legs."""
    length_m, width_m, height_m = kind.size_m
    x_m, y_m, seat_m = length_m / 2 - _INSET_M, width_m / 2 - _INSET_M, height_m / 2
    yield replace(_box((-x_m, x_m), (-y_m, y_m), (seat_m - kind.board_m, seat_m)), roofed=True)
    back_m = (y_m - min(kind.board_m, kind.post_m / 2), y_m)
    yield _box((-x_m, x_m), back_m, (0.62 * height_m, height_m - _INSET_M))
    yield from _legs(kind, 0.0, seat_m - kind.board_m, height_m)


def _legs(kind: ObjectKind, inset_m: float, front_m: float, back_m: float) -> Iterator[Part]:
    """Yield four legs at the corners, moved inwards, of a height in front and at the back."""
    half_m = kind.post_m / 2
    x_m, y_m = (side / 2 - inset_m - half_m for side in kind.size_m[:2])
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        top_m = back_m if sy > 0 else front_m
        leg = block((half_m, half_m), 0.0, top_m, (sx * x_m, sy * y_m))
        yield replace(leg, look="frame")


def _shelf(kind: ObjectKind) -> Iterator[Part]:
    """Yield sides, a back, and boards, of which the lowest stands on a plinth."""
    length_m, width_m, height_m = kind.size_m
    x_m, y_m, thick_m = length_m / 2, width_m / 2, min(kind.board_m, length_m / 8)
    plinth_m = height_m / (8 * kind.shelves)
    inner_m = (-x_m + thick_m, x_m - thick_m)
    deep_m = (-y_m + _INSET_M, y_m - _INSET_M)
    yield _box((-x_m, -x_m + thick_m), (-y_m, y_m), (0.0, height_m - kind.board_m))
    yield _box((x_m - thick_m, x_m), (-y_m, y_m), (0.0, height_m - kind.board_m))
    yield _box(inner_m, (y_m - thick_m / 2, y_m), (0.0, height_m - kind.board_m), "frame")
    yield _box(inner_m, (-y_m + thick_m, y_m - thick_m), (0.0, plinth_m), "detail")
    for top_m in np.linspace(plinth_m + kind.board_m, height_m, kind.shelves + 1).tolist()[:-1]:
        yield _box(inner_m, deep_m, (top_m - kind.board_m, top_m))
    lid = _box((-x_m, x_m), (-y_m, y_m), (height_m - kind.board_m, height_m))
    yield replace(lid, roofed=True)


def _by_shares(kind: ObjectKind) -> Iterator[Part]:
    (length_m, width_m, height_m), base_m = kind.size_m, _above_floor_m(kind)
    for (left, right), (front, back), (low, high), look in _SHARES[kind.shape]:
        part = _box(
            (left * length_m / 2, right * length_m / 2),
            (front * width_m / 2, back * width_m / 2),
            (base_m + low * height_m, base_m + high * height_m),
            look,
        )
        yield replace(part, roofed=kind.shape == "cabinet" and high == 1.0)
    if kind.shape == "person":
        radius_m = min(0.22 * length_m, 0.34 * width_m)
        head = block((radius_m, radius_m), 0.86 * height_m, height_m)
        yield replace(head, look="frame", footprint=replace(head.footprint, round=True))


# Boxes as shares: along x and y of the half sizes, along z of the height.
_SHARES: Final[Mapping[str, tuple[tuple[Span, Span, Span, Look], ...]]] = {
    "cabinet": (
        ((-0.96, 0.96), (-0.70, 1.00), (0.00, 0.07), "detail"),
        ((-1.00, 1.00), (-0.88, 1.00), (0.07, 1.00), "surface"),
        ((-0.012, 0.012), (-0.89, -0.88), (0.07, 0.97), "detail"),  # gap between its doors
        ((-0.20, -0.15), (-1.00, -0.88), (0.55, 0.72), "detail"),  # handles
        ((0.15, 0.20), (-1.00, -0.88), (0.55, 0.72), "detail"),
    ),
    "person": (
        ((-0.58, 0.58), (-0.60, 0.60), (0.00, 0.48), "detail"),  # trousers
        ((-0.72, 0.72), (-0.75, 0.75), (0.48, 0.82), "surface"),
        ((-1.00, -0.74), (-0.45, 0.45), (0.48, 0.81), "surface"),  # arms and hands
        ((0.74, 1.00), (-0.45, 0.45), (0.48, 0.81), "surface"),
        ((-0.98, -0.76), (-0.40, 0.40), (0.42, 0.48), "frame"),
        ((0.76, 0.98), (-0.40, 0.40), (0.42, 0.48), "frame"),
        ((-0.24, 0.24), (-0.35, 0.35), (0.82, 0.86), "frame"),  # neck
    ),
    "door": (
        ((-0.87, 0.87), (0.20, 1.00), (0.00, 0.95), "surface"),
        ((-1.00, -0.86), (-0.40, 1.00), (0.00, 1.00), "frame"),
        ((0.86, 1.00), (-0.40, 1.00), (0.00, 1.00), "frame"),
        ((-0.86, 0.86), (-0.40, 1.00), (0.94, 1.00), "frame"),
        ((0.62, 0.80), (-1.00, 0.20), (0.495, 0.51), "detail"),  # handle
    ),
    "window": (
        ((-0.92, 0.92), (0.40, 1.00), (0.05, 0.95), "surface"),
        ((-1.00, 1.00), (-1.00, 1.00), (0.00, 0.03), "frame"),  # sill
        ((-0.97, -0.90), (0.00, 1.00), (0.03, 1.00), "frame"),
        ((0.90, 0.97), (0.00, 1.00), (0.03, 1.00), "frame"),
        ((-0.90, 0.90), (0.00, 1.00), (0.03, 0.10), "frame"),
        ((-0.90, 0.90), (0.00, 1.00), (0.94, 1.00), "frame"),
        ((-0.03, 0.03), (0.10, 1.00), (0.10, 0.94), "frame"),
    ),
}
_MAKERS: Final[Mapping[str, Callable[[ObjectKind], Iterator[Part]]]] = {
    "table": _table,
    "round_table": _table,
    "rack": _rack,
    "chair": _chair,
    "shelf": _shelf,
    **dict.fromkeys(_SHARES, _by_shares),
}
