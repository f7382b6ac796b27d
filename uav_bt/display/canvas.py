"""Drawing on images: colours, text and shapes that all panes share.

Images are (H, W, 3) uint8 RGB and are changed in place. Text must be ASCII, because OpenCV 4 draws
no other characters.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from uav_bt.types.arrays import Image

Colour = tuple[int, int, int]
Point = tuple[float, float]
Size = tuple[int, int]  # width and height, pixels

BACKDROP: Final[Colour] = (17, 19, 24)
PANEL: Final[Colour] = (27, 30, 37)
INK: Final[Colour] = (232, 234, 237)
DIM: Final[Colour] = (139, 146, 158)
ACCENT: Final[Colour] = (255, 196, 0)
ALARM: Final[Colour] = (255, 92, 92)

_FONT: Final = cv2.FONT_HERSHEY_SIMPLEX
# Polygons are drawn in sixteenths of a pixel, so that slow movements look smooth.
_SUBPIXEL_BITS: Final = 4


def blank(size_px: Size, colour: Colour) -> Image:
    """Return an image of one colour."""
    return np.full((size_px[1], size_px[0], 3), colour, dtype=np.uint8)


def empty_pane(words: str, size_px: Size) -> Image:
    """Return a pane with only a line of text."""
    image = blank(size_px, PANEL)
    text = shortened(words, size_px[0] - 16, 0.42)
    put_centred(image, text, (size_px[0] / 2, size_px[1] / 2))
    return image


def circle(centre: Iterable[float], radius: float) -> list[Point]:
    """Return a circle as a closed polyline."""
    x, y = centre
    angles = np.linspace(0.0, 2.0 * math.pi, 32)
    return [(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles]


def _subpixel(points_px: ArrayLike) -> NDArray[np.int32]:
    places = np.asarray(points_px, dtype=np.float64) * (1 << _SUBPIXEL_BITS)
    return np.rint(places).astype(np.int32)


def put(
    image: Image,
    text: str,
    at_px: tuple[int, int],
    *,
    colour: Colour = INK,
    scale: float = 0.5,
    bold: bool = False,
) -> None:
    """Write a line of text; `at_px` is the left end of its baseline."""
    cv2.putText(image, text, at_px, _FONT, scale, colour, 2 if bold else 1, cv2.LINE_AA)


def text_width_px(text: str, scale: float = 0.5, *, bold: bool = False) -> int:
    """Return the width of a text, pixels."""
    return int(cv2.getTextSize(text, _FONT, scale, 2 if bold else 1)[0][0])


def put_centred(
    image: Image, text: str, at_px: Point, *, colour: Colour = INK, scale: float = 0.42
) -> None:
    """Write a line of text around a point of its baseline."""
    left = round(at_px[0] - text_width_px(text, scale) / 2)
    put(image, text, (left, round(at_px[1])), colour=colour, scale=scale)


def shortened(text: str, room_px: int, scale: float = 0.5, *, bold: bool = False) -> str:
    """Return a text of limited width, cut with three dots if necessary."""
    if text_width_px(text, scale, bold=bold) <= room_px:
        return text
    kept = len(text)
    while kept and text_width_px(f"{text[:kept]}...", scale, bold=bold) > room_px:
        kept -= 1
    return f"{text[:kept].rstrip()}..."


def tag(
    image: Image, text: str, at_px: tuple[int, int], *, colour: Colour = INK, scale: float = 0.45
) -> None:
    """Write a text on a dark plate, readable on any image and kept inside it."""
    height_px, width_px = image.shape[:2]
    text = shortened(text, width_px - 12, scale)
    wide, high = text_width_px(text, scale) + 12, round(44 * scale)
    left = min(max(at_px[0], 0), max(width_px - wide, 0))
    top = min(max(at_px[1], 0), max(height_px - high, 0))
    image[top : top + high, left : left + wide] //= 4
    put(image, text, (left + 6, top + round(31 * scale)), colour=colour, scale=scale)


def draw_legend(
    image: Image, entries: Iterable[tuple[str, Colour]], at_px: tuple[int, int], scale: float = 0.4
) -> None:
    """Write names behind dashes of their colours, in at most two rows."""
    left, base = at_px
    for words, colour in entries:
        wide = 16 + text_width_px(words, scale) + 14
        if left + wide > image.shape[1]:
            left, base = at_px[0], base + 18
        if base > at_px[1] + 18:
            return
        line(image, [(left, base - 4), (left + 10, base - 4)], colour, 5)
        put(image, words, (left + 16, base), scale=scale)
        left += wide


def line(image: Image, points_px: ArrayLike, colour: Colour, width_px: int = 1) -> None:
    """Draw an open polyline, (N, 2) pixels, anti-aliased."""
    points = _subpixel(points_px)
    cv2.polylines(image, [points], False, colour, width_px, cv2.LINE_AA, _SUBPIXEL_BITS)


def polygon(
    image: Image, points_px: ArrayLike, fill: Colour | None, edge: Colour | None = None
) -> None:
    """Draw a filled polygon, (N, 2) pixels, an outline, or both; anti-aliased."""
    points = _subpixel(points_px)
    if fill is not None:
        cv2.fillPoly(image, [points], fill, cv2.LINE_AA, _SUBPIXEL_BITS)
    if edge is not None:
        cv2.polylines(image, [points], True, edge, 1, cv2.LINE_AA, _SUBPIXEL_BITS)


def resized(image: Image, size_px: Size, interpolation: int = cv2.INTER_NEAREST) -> Image:
    """Return an image at another size."""
    return np.asarray(cv2.resize(image, size_px, interpolation=interpolation), dtype=np.uint8)
