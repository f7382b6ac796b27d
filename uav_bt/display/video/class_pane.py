"""Pane of the class map: pixels in the colours of their classes, with a legend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.display.canvas import ALARM, DIM, INK, Colour, polygon, put, tag, text_width_px
from uav_bt.display.video.depth_panes import empty_pane
from uav_bt.errors import ShapeError
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Image

_IDS: Final = 256  # number of values of an uint8
_LEAST_SHARE: Final = 0.001  # least share of pixels in the legend, so that it does not flicker
_SCALE: Final = 0.4
_SWATCH_PX: Final = 10
_ROW_PX: Final = 20
_EDGE_PX: Final = 10  # free margin around title and legend
_TITLE_SCALE: Final = 0.45
_ROOMY_PX: Final = 400  # panes from this width on show the size of the map
_UNKNOWN: Final = "unknown"


@dataclass(frozen=True, kw_only=True, eq=False)
class ClassPalette:
    """Names and colours of the classes.

    Raises:
        ShapeError: the numbers of names and colours differ.
    """

    names: tuple[str, ...]  # by class id
    colours: NDArray[np.uint8]  # (N, 3) RGB by class id

    def __post_init__(self) -> None:
        if self.colours.shape != (len(self.names), 3) or len(self.names) > _IDS:
            expected = f"{len(self.names)}x3"
            raise ShapeError("class colours", expected=expected, actual=self.colours.shape)

    @cached_property
    def table(self) -> NDArray[np.uint8]:
        """(256, 3) RGB: the colours of all ids; ids without a class have the alarm colour."""
        table = np.full((_IDS, 3), ALARM, dtype=np.uint8)
        table[: len(self.colours)] = self.colours
        return table

    def entries(self, ids: NDArray[np.uint8]) -> list[tuple[str, Colour]]:
        """Return name and colour of the visible classes, in the order of their ids.

        Args:
            ids: (H, W) uint8 class ids.
        """
        shares = np.bincount(ids.ravel(), minlength=_IDS) / ids.size
        found = [int(number) for number in np.flatnonzero(shares >= _LEAST_SHARE)]
        known = [number for number in found if number < len(self.names)]
        entries = [(self.names[number].replace("_", " "), self._colour(number)) for number in known]
        return entries if len(known) == len(found) else [*entries, (_UNKNOWN, ALARM)]

    def _colour(self, number: int) -> Colour:
        red, green, blue = (int(value) for value in self.colours[number])
        return red, green, blue


def draw_class_map(
    class_map: ClassMap | None, palette: ClassPalette, size_px: tuple[int, int]
) -> Image:
    """Return the class map in colours, with a legend.

    Args:
        class_map: the class map; None draws an empty pane.
        palette: names and colours of its classes.
        size_px: width and height of the pane.
    """
    if class_map is None:
        return empty_pane("no class map", size_px)
    ids = class_map.ids
    image: Image = np.asarray(
        cv2.resize(palette.table[ids], size_px, interpolation=cv2.INTER_NEAREST), dtype=np.uint8
    )
    title = "class map"
    if size_px[0] >= _ROOMY_PX:
        title += f"  {ids.shape[1]} x {ids.shape[0]}"
    tag(image, title, (_EDGE_PX, _EDGE_PX), colour=DIM, scale=_TITLE_SCALE)
    title_px = text_width_px(title, _TITLE_SCALE) + 18
    _draw_legend(image, palette.entries(ids), title_px)
    return image


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
