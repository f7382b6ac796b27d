"""Where the boxes of a tree go: level by level, parents above the middle of their children.

Subtrees are pushed together until they nearly touch, level by level, so that a narrow subtree slips
under its wide neighbour (the contours of Reingold and Tilford, for boxes of different widths).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from uav_bt.tree.render.sketch import Box

_BESIDE_PX: Final = 14.0  # between neighbours
_BELOW_PX: Final = 34.0  # between levels: room for the lines


@dataclass(frozen=True, kw_only=True)
class Size:
    """How large a box is drawn, px."""

    width_px: float
    height_px: float


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a box is drawn, px, from the upper left corner of the image."""

    left_px: float
    top_px: float
    width_px: float
    height_px: float

    @property
    def middle_px(self) -> float:
        """Its horizontal middle."""
        return self.left_px + self.width_px / 2.0


class _Contour:
    """How far a subtree reaches to both sides on each level, from its root's middle."""

    def __init__(self, half_width_px: float) -> None:
        self.left = [-half_width_px]
        self.right = [half_width_px]


def arrange(root: Box, sizes: Mapping[int, Size]) -> dict[int, Place]:
    """Return the places of a box and all below.

    Args:
        root: the uppermost box.
        sizes: of each box, by its `id()`.

    Returns:
        The places by the boxes' `id()`; the leftmost is at 0, the uppermost, too.
    """
    shifts: dict[int, float] = {}  # of a box from its parent
    contours: dict[int, _Contour] = {}
    boxes = list(root.walk())
    for box in reversed(boxes):  # children first
        contours[id(box)] = _join(box, sizes[id(box)], contours, shifts)
    levels = _levels(root)
    tops = _tops(levels, sizes)
    middles = {id(root): -min(contours[id(root)].left)}
    places: dict[int, Place] = {}
    for level, top_px in zip(levels, tops, strict=True):
        for box in level:
            size, middle = sizes[id(box)], middles[id(box)]
            places[id(box)] = Place(
                left_px=middle - size.width_px / 2.0,
                top_px=top_px,
                width_px=size.width_px,
                height_px=size.height_px,
            )
            for child in box.children:
                middles[id(child)] = middle + shifts[id(child)]
    return places


def _join(
    box: Box, size: Size, contours: dict[int, _Contour], shifts: dict[int, float]
) -> _Contour:
    joined = _Contour(size.width_px / 2.0)
    if not box.children:
        return joined
    left: list[float] = []
    right: list[float] = []
    offsets: list[float] = []
    for child in box.children:
        contour = contours.pop(id(child))
        shared = zip(right, contour.left, strict=False)
        offset = max((there - here + _BESIDE_PX for there, here in shared), default=0.0)
        offsets.append(offset)
        left += [reach + offset for reach in contour.left[len(left) :]]
        moved = [reach + offset for reach in contour.right]
        right[: len(moved)] = moved
    middle = (offsets[0] + offsets[-1]) / 2.0
    for child, offset in zip(box.children, offsets, strict=True):
        shifts[id(child)] = offset - middle
    joined.left += [reach - middle for reach in left]
    joined.right += [reach - middle for reach in right]
    return joined


def _levels(root: Box) -> list[list[Box]]:
    levels = [[root]]
    while below := [child for box in levels[-1] for child in box.children]:
        levels.append(below)
    return levels


def _tops(levels: list[list[Box]], sizes: Mapping[int, Size]) -> list[float]:
    tops = [0.0]
    for level in levels[:-1]:
        tops.append(tops[-1] + max(sizes[id(box)].height_px for box in level) + _BELOW_PX)
    return tops
