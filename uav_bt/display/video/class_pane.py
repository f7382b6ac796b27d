"""The class map's pane: each pixel in the colour of its class, and a legend of those in view."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.display.canvas import ALARM, DIM, INK, Colour, Image, polygon, put, tag, text_width_px
from uav_bt.display.video.depth_panes import empty_pane
from uav_bt.errors import ShapeError
from uav_bt.types import ClassMap

_IDS: Final = 256  # of an uint8
_LEAST_SHARE: Final = 0.001  # of the pixels: single ones would make the legend flicker
_SCALE: Final = 0.4
_SWATCH_PX: Final = 10
_ROW_PX: Final = 18
_ROWS: Final = 2  # the legend covers the far end of the view only
_LEFT_PX, _TOP_PX = 10, 32  # of the legend's first row, below the pane's title
_UNKNOWN: Final = "unknown"


@dataclass(frozen=True, kw_only=True, eq=False)
class ClassPalette:
    """Names and colours of the classes.

    Raises:
        ShapeError: there is not one colour for each name.
    """

    names: tuple[str, ...]  # by class id
    colours: NDArray[np.uint8]  # (N, 3) RGB by class id

    def __post_init__(self) -> None:
        if self.colours.shape != (len(self.names), 3) or len(self.names) > _IDS:
            expected = f"{len(self.names)}x3"
            raise ShapeError("class colours", expected=expected, actual=self.colours.shape)

    @cached_property
    def table(self) -> NDArray[np.uint8]:
        """(256, 3) RGB: the colours of all ids; those without a class have the alarm colour."""
        table = np.full((_IDS, 3), ALARM, dtype=np.uint8)
        table[: len(self.colours)] = self.colours
        return table

    def entries(self, ids: NDArray[np.uint8]) -> list[tuple[str, Colour]]:
        """Return name and colour of the classes that are in view, in the order of their ids.

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
    """Return the class map in its colours with a legend, as large as the camera's image.

    Args:
        class_map: None draws an empty pane.
        palette: of its classes.
        size_px: width and height of the pane.
    """
    if class_map is None:
        return empty_pane("no class map", size_px)
    ids = class_map.ids
    image: Image = np.asarray(
        cv2.resize(palette.table[ids], size_px, interpolation=cv2.INTER_NEAREST), dtype=np.uint8
    )
    tag(image, f"class map  {ids.shape[1]} x {ids.shape[0]}", (10, 10), colour=DIM)
    _draw_legend(image, palette.entries(ids))
    return image


def _draw_legend(image: Image, entries: Sequence[tuple[str, Colour]]) -> None:
    for row, cells in enumerate(_rows(entries, image.shape[1] - 2 * _LEFT_PX)):
        top = _TOP_PX + row * _ROW_PX
        wide = sum(_cell_px(name) for name, _ in cells)
        image[top : top + _ROW_PX, _LEFT_PX : _LEFT_PX + wide] //= 4
        left = _LEFT_PX + 6
        for name, colour in cells:
            low, right = top + 4 + _SWATCH_PX, left + _SWATCH_PX
            corners = [(left, top + 4), (right, top + 4), (right, low), (left, low)]
            polygon(image, corners, colour, INK)
            put(image, name, (right + 5, top + 13), scale=_SCALE)
            left += _cell_px(name)


def _cell_px(name: str) -> int:
    return _SWATCH_PX + 5 + text_width_px(name, _SCALE) + 12


def _rows(
    entries: Sequence[tuple[str, Colour]], width_px: int
) -> Iterator[list[tuple[str, Colour]]]:
    """Yield the rows of a legend; what does not fit into the last one is left out."""
    row: list[tuple[str, Colour]] = []
    rows, wide = 0, 0
    for name, colour in entries:
        cell_px = _cell_px(name)
        if row and wide + cell_px > width_px:
            yield row
            row, wide, rows = [], 0, rows + 1
            if rows == _ROWS:
                return
        row.append((name, colour))
        wide += cell_px
    if row:
        yield row
