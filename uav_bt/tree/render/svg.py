"""A tree as an SVG image: no fonts, scripts or files from elsewhere.

Boxes go level by level, parents above the middle of their children. Subtrees are pushed together
until they nearly touch, so that a narrow subtree slips under its wide neighbour (the contours of
Reingold and Tilford, for boxes of different widths).
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from xml.sax.saxutils import escape

from uav_bt.tree.node import NodeKind
from uav_bt.tree.render.sketch import Box, one_line

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


_MARGIN_PX: Final = 20.0
_TITLE_PX: Final = 34.0  # above the tree
_PADDING_PX: Final = 10.0  # inside a box, left and right
_HEAD_PX: Final = 24.0  # the coloured part with the tag
_LINE_PX: Final = 15.0
_SMALL_PX: Final = 11.0  # letters of attributes and keys
_LARGE_PX: Final = 13.0  # letters of tags

# Letters of a sans-serif fount in parts of its size, so that a text fits whatever fount is there.
_NARROW: Final = frozenset("ijltfrI.,:;|!'()[]{} -/\\")
_WIDE: Final = frozenset("mwMW@%#&")
_BOLD: Final = 1.12  # bold letters are wider
_NARROW_EM, _WIDE_EM, _CAPITAL_EM, _USUAL_EM, _FULL_EM = 0.38, 0.92, 0.72, 0.6, 1.05


@dataclass(frozen=True, kw_only=True)
class _Look:
    head: str  # behind the tag
    body: str  # behind the rest
    radius_px: float  # of the corners: leaves are rounder than what holds them


_LOOKS: Final = {
    NodeKind.CONTROL: _Look(head="#1f5fa8", body="#eaf2fb", radius_px=3.0),
    NodeKind.DECORATOR: _Look(head="#7a4aa3", body="#f5eefa", radius_px=3.0),
    NodeKind.SUBTREE: _Look(head="#4d5561", body="#f0f1f3", radius_px=3.0),
    NodeKind.ACTION: _Look(head="#1d7a46", body="#ebf7f0", radius_px=9.0),
    NodeKind.CONDITION: _Look(head="#a8690c", body="#fdf5e6", radius_px=9.0),
}

_STYLE: Final = (
    "text{font-family:'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;fill:#1c2733}"
    ".title{font-size:16px;font-weight:bold}"
    f".tag{{font-size:{_LARGE_PX:g}px;font-weight:bold;fill:#fff}}"
    f".name{{font-size:{_SMALL_PX:g}px;font-weight:bold}}"
    f".attribute{{font-size:{_SMALL_PX:g}px}}"
    f".keys{{font-size:{_SMALL_PX:g}px;fill:#5b6775}}"
    ".line{fill:none;stroke:#8a96a3;stroke-width:1.5}"
)


def svg(root: Box, title: str) -> str:
    """Return a tree as an SVG document.

    Args:
        root: the uppermost box.
        title: above the tree.
    """
    sizes = {id(box): _size(box) for box in root.walk()}
    places = arrange(root, sizes)
    width = max(place.left_px + place.width_px for place in places.values())
    height = max(place.top_px + place.height_px for place in places.values())
    title = one_line(title, 60)
    width = max(width, _width(title, 16.0)) + 2.0 * _MARGIN_PX
    height += 2.0 * _MARGIN_PX + _TITLE_PX
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
        f"<title>{escape(title)}</title>",
        f"<style>{_STYLE}</style>",
        '<rect width="100%" height="100%" fill="#fff"/>',
        f'<text class="title" x="{_MARGIN_PX:g}" y="{_MARGIN_PX + 14.0:g}">{escape(title)}</text>',
        f'<g transform="translate({_MARGIN_PX:g} {_MARGIN_PX + _TITLE_PX:g})">',
    ]
    for box in root.walk():
        lines += [_line(places[id(box)], places[id(child)]) for child in box.children]
    for box in root.walk():
        lines += _drawn(box, places[id(box)])
    return "\n".join([*lines, "</g>", "</svg>", ""])


def _texts(box: Box) -> list[tuple[str, str]]:
    name = [("name", box.name)] if box.name else []
    attributes = [("attribute", text) for text in box.attributes]
    return [*name, *attributes, *(("keys", text) for text in box.keys)]


def _size(box: Box) -> Size:
    texts = _texts(box)
    widths = [_width(box.tag, _LARGE_PX) * _BOLD]
    widths += [_width(text, _SMALL_PX) * (_BOLD if look == "name" else 1.0) for look, text in texts]
    body = len(texts) * _LINE_PX + 8.0 if texts else 0.0
    return Size(width_px=max(widths) + 2.0 * _PADDING_PX, height_px=_HEAD_PX + body)


def _width(text: str, size_px: float) -> float:
    return math.fsum(map(_em, text)) * size_px  # exact: equal in all versions of Python


def _em(char: str) -> float:
    if char in _NARROW:
        return _NARROW_EM
    if char in _WIDE:
        return _WIDE_EM
    if unicodedata.east_asian_width(char) in "WF":
        return _FULL_EM
    return _CAPITAL_EM if char.isupper() else _USUAL_EM


def _line(above: Place, below: Place) -> str:
    x1, y1 = above.middle_px, above.top_px + above.height_px
    x2, y2 = below.middle_px, below.top_px
    bend = y2 - 17.0  # all children of a node branch off at one height
    return (
        f'<path class="line" d="M{x1:.1f} {y1:.1f}V{bend:.1f}H{x2:.1f}V{y2:.1f}"/>'
        if abs(x1 - x2) > 0.05
        else f'<path class="line" d="M{x1:.1f} {y1:.1f}V{y2:.1f}"/>'
    )


def _drawn(box: Box, place: Place) -> list[str]:
    look = _LOOKS[box.kind]
    x, y, width, height = place.left_px, place.top_px, place.width_px, place.height_px
    radius = look.radius_px
    frame = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="{radius:g}"'
    # The head is round above; below, it meets the body in a straight line.
    head = (
        f"M{x:.1f} {y + _HEAD_PX:.1f}V{y + radius:.1f}q0 {-radius:g} {radius:g} {-radius:g}"
        f"H{x + width - radius:.1f}q{radius:g} 0 {radius:g} {radius:g}V{y + _HEAD_PX:.1f}z"
    )
    texts = _texts(box)
    lines = [
        "<g>",
        f"<title>{escape(': '.join(text for text in (box.path, box.doc) if text))}</title>",
        f'<rect {frame} fill="{look.body if texts else look.head}" stroke="{look.head}"/>',
    ]
    if texts:
        lines.append(f'<path d="{head}" fill="{look.head}"/>')
    at = x + _PADDING_PX
    lines.append(f'<text class="tag" x="{at:.1f}" y="{y + 16.5:.1f}">{escape(box.tag)}</text>')
    for row, (style, text) in enumerate(texts):
        below = y + _HEAD_PX + 4.0 + (row + 0.78) * _LINE_PX
        lines.append(
            f'<text class="{style}" x="{at:.1f}" y="{below:.1f}" xml:space="preserve">'
            f"{escape(text)}</text>"
        )
    return [*lines, "</g>"]
