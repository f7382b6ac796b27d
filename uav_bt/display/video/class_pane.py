"""Pane of the class map: pixels in the colours of their classes, with a legend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import cv2
import numpy as np

from uav_bt.display.canvas import DIM, INK, Colour, polygon, put, tag, text_width_px
from uav_bt.display.video.depth_panes import empty_pane
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Image

_LEAST_SHARE: Final = 0.001  # least share of pixels in the legend, so that it does not flicker
_SCALE: Final = 0.4
_SWATCH_PX: Final = 10
_ROW_PX: Final = 20
_EDGE_PX: Final = 10  # free margin around title and legend
_TITLE_SCALE: Final = 0.45
_ROOMY_PX: Final = 400  # panes from this width on show the size of the map


def draw_class_map(class_map: ClassMap | None, size_px: tuple[int, int]) -> Image:
    """Return the class map in the colours of its classes, with a legend.

    Args:
        class_map: the class map; None draws an empty pane.
        size_px: width and height of the pane.
    """
    if class_map is None:
        return empty_pane("no class map", size_px)
    ids = class_map.ids
    image: Image = np.asarray(
        cv2.resize(class_map.classes.colourise(ids), size_px, interpolation=cv2.INTER_NEAREST),
        dtype=np.uint8,
    )
    title = "class map"
    if size_px[0] >= _ROOMY_PX:
        title += f"  {ids.shape[1]} x {ids.shape[0]}"
    tag(image, title, (_EDGE_PX, _EDGE_PX), colour=DIM, scale=_TITLE_SCALE)
    title_px = text_width_px(title, _TITLE_SCALE) + 18
    _draw_legend(image, _entries(class_map), title_px)
    return image


def _entries(class_map: ClassMap) -> list[tuple[str, Colour]]:
    """Return name and colour of the visible classes, in the order of their ids."""
    counts = np.bincount(class_map.ids.ravel())
    found = np.flatnonzero(counts >= _LEAST_SHARE * class_map.ids.size).tolist()
    listed = list(class_map.classes)
    return [(listed[each].name.replace("_", " "), listed[each].colour) for each in found]


def _draw_legend(image: Image, entries: Sequence[tuple[str, Colour]], title_px: int) -> None:
    """Draw the legend beside the title and, if necessary, below it."""
    room_px = image.shape[1] - 2 * _EDGE_PX
    for row, cells in enumerate(_rows(entries, (room_px - title_px, room_px))):
        top = _EDGE_PX + row * _ROW_PX
        left = _EDGE_PX + (title_px if row == 0 else 0)
        wide = sum(_cell_px(name) for name, _ in cells)
        image[top : top + _ROW_PX, left : left + wide] //= 4
        left += 6
        for name, colour in cells:
            low, right = top + 5 + _SWATCH_PX, left + _SWATCH_PX
            corners = [(left, top + 5), (right, top + 5), (right, low), (left, low)]
            polygon(image, corners, colour, INK)
            put(image, name, (right + 5, top + 14), scale=_SCALE)
            left += _cell_px(name)


def _cell_px(name: str) -> int:
    return _SWATCH_PX + 5 + text_width_px(name, _SCALE) + 12


def _rows(
    entries: Sequence[tuple[str, Colour]], widths_px: Sequence[int]
) -> Iterator[list[tuple[str, Colour]]]:
    """Yield the rows of a legend, one for each width; entries that do not fit are omitted."""
    left = list(entries)
    for width_px in widths_px:
        row: list[tuple[str, Colour]] = []
        while left and sum(_cell_px(name) for name, _ in (*row, left[0])) <= width_px:
            row.append(left.pop(0))
        yield row
