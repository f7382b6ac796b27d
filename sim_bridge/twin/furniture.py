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
    usual = _by_shares if kind.shape in _SHARES else whole
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
    yield from _legs(kind, 0.0, height_m) if kind.shape == "rack" else _by_shares(kind)


def _legs(kind: ObjectKind, inset_m: float, top_m: float) -> Iterator[Part]:
    """Yield four legs at the corners, moved inwards."""
    half_m = kind.post_m / 2
    x_m, y_m = (side / 2 - inset_m - half_m for side in kind.size_m[:2])
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        leg = block((half_m, half_m), 0.0, top_m, (sx * x_m, sy * y_m))
        yield replace(leg, look="frame")


def _by_shares(kind: ObjectKind) -> Iterator[Part]:
    (length_m, width_m, height_m), base_m = kind.size_m, kind.above_floor_m or 0.0
    for (left, right), (front, back), (low, high), look in _SHARES[kind.shape]:
        half_m = ((right - left) * length_m / 4, (back - front) * width_m / 4)
        middle_m = ((right + left) * length_m / 4, (back + front) * width_m / 4)
        part = block(half_m, base_m + low * height_m, base_m + high * height_m, middle_m)
        yield replace(part, look=look, roofed=(kind.shape, high) in _ROOFED)
    if kind.shape == "person":
        radius_m = min(0.22 * length_m, 0.34 * width_m)
        head = block((radius_m, radius_m), 0.86 * height_m, height_m)
        yield replace(head, look="frame", footprint=replace(head.footprint, round=True))


# Boxes as shares: along x and y of the half sizes, along z of the height.
_SHARES: Final[Mapping[str, tuple[tuple[Span, Span, Span, Look], ...]]] = {
    "chair": (
        ((-0.98, 0.98), (-0.98, 0.98), (0.46, 0.50), "surface"),
        ((-0.98, 0.98), (0.86, 0.96), (0.62, 0.99), "surface"),
        ((-1.00, -0.80), (-1.00, -0.80), (0.00, 0.46), "frame"),  # legs
        ((0.80, 1.00), (-1.00, -0.80), (0.00, 0.46), "frame"),
        ((-1.00, -0.80), (0.80, 1.00), (0.00, 1.00), "frame"),
        ((0.80, 1.00), (0.80, 1.00), (0.00, 1.00), "frame"),
    ),
    "shelf": (
        ((-1.00, -0.94), (-1.00, 1.00), (0.00, 1.00), "surface"),  # sides
        ((0.94, 1.00), (-1.00, 1.00), (0.00, 1.00), "surface"),
        ((-0.94, 0.94), (0.90, 1.00), (0.00, 0.985), "frame"),
        ((-0.94, 0.94), (-0.85, 0.90), (0.00, 0.035), "detail"),  # plinth
    ),
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
_ROOFED: Final = {("cabinet", 1.0), ("chair", 0.5)}  # and the heights of their upper faces
