"""Panes of the class map, of metric depth and of the corridor."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.board.blackboard import Reading
from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, DIM, INK, PANEL, Colour, Size
from uav_bt.display.flown_path import Shown
from uav_bt.display.phrases import describe_corridor, describe_free
from uav_bt.types import ClassMap, Corridor, DepthMap, Frame
from uav_bt.types.arrays import Image

Intruding = Callable[[Frame, ClassMap, DepthMap], NDArray[np.bool_]]
"""Returns which pixels of a depth map are inside the corridor, (H, W)."""

FARTHEST_M: Final = 5.0  # end of the depth's scale: the length of the paper's carpet
_UNKNOWN: Final[Colour] = (70, 74, 84)  # grey, which is not in the scale
_BAR_WIDTH_PX: Final = 10
_OPACITY: Final = 0.6  # opacity of the mark on intruding pixels
_LEAST_SHARE: Final = 0.001  # least share of pixels in the legend, so that it does not flicker
_SCALE: Final = 0.4  # of the legend
_SWATCH_PX: Final = 10
_ROW_PX: Final = 20
_EDGE_PX: Final = 10  # free margin around title and legend
_ROOMY_PX: Final = 400  # panes from this width on show more numbers

Row = tuple[str, str, Colour]  # name, value and its colour
_Entry = tuple[str, Colour]  # name and colour of a class


def empty_pane(words: str, size_px: Size) -> Image:
    """Return a pane with only a line of text."""
    image = canvas.blank(size_px, PANEL)
    scale = 0.5
    while canvas.text_width_px(words, scale) > size_px[0] - 16 and scale > 0.3:
        scale -= 0.05
    left = (size_px[0] - canvas.text_width_px(words, scale)) // 2
    canvas.put(image, words, (left, size_px[1] // 2), scale=scale)
    return image


def draw_class_map(class_map: ClassMap | None, size_px: Size) -> Image:
    """Return the class map in the colours of its classes, with a legend."""
    if class_map is None:
        return empty_pane("no class map", size_px)
    ids = class_map.ids
    image = canvas.resized(class_map.classes.colourise(ids), size_px)
    title = "class map"
    if size_px[0] >= _ROOMY_PX:
        title += f"  {ids.shape[1]} x {ids.shape[0]}"
    canvas.tag(image, title, (_EDGE_PX, _EDGE_PX), colour=DIM)
    # The legend stands beside the title and, if necessary, below it.
    title_px, room_px = canvas.text_width_px(title, 0.45) + 18, size_px[0] - 2 * _EDGE_PX
    for row, cells in enumerate(_rows(legend_of(class_map), (room_px - title_px, room_px))):
        top, left = _EDGE_PX + row * _ROW_PX, _EDGE_PX + (0 if row else title_px)
        wide = sum(_cell_px(name) for name, _ in cells)
        image[top : top + _ROW_PX, left : left + wide] //= 4
        left += 6
        for name, colour in cells:
            low, right = top + 5 + _SWATCH_PX, left + _SWATCH_PX
            corners = [(left, top + 5), (right, top + 5), (right, low), (left, low)]
            canvas.polygon(image, corners, colour, INK)
            canvas.put(image, name, (right + 5, top + 14), scale=_SCALE)
            left += _cell_px(name)
    return image


def legend_of(class_map: ClassMap) -> list[_Entry]:
    """Return name and colour of the visible classes, in the order of their ids."""
    counts = np.bincount(class_map.ids.ravel())
    found = np.flatnonzero(counts >= _LEAST_SHARE * class_map.ids.size).tolist()
    listed = list(class_map.classes)
    return [(listed[each].name.replace("_", " "), listed[each].colour) for each in found]


def _cell_px(name: str) -> int:
    return _SWATCH_PX + 5 + canvas.text_width_px(name, _SCALE) + 12


def _rows(entries: Sequence[_Entry], widths_px: Sequence[int]) -> Iterator[list[_Entry]]:
    """Yield the rows of a legend, one for each width; entries that do not fit are omitted."""
    left = list(entries)
    for width_px in widths_px:
        row: list[_Entry] = []
        while left and sum(_cell_px(name) for name, _ in (*row, left[0])) <= width_px:
            row.append(left.pop(0))
        yield row


@functools.cache
def _scale_colours() -> NDArray[np.uint8]:
    """Return (256, 3) RGB from near (red) to far (blue)."""
    ramp = np.arange(255, -1, -1, dtype=np.uint8).reshape(-1, 1)
    return np.asarray(cv2.applyColorMap(ramp, cv2.COLORMAP_TURBO)[:, 0, ::-1], dtype=np.uint8)


def draw_depth(depth: DepthMap | None, size_px: Size, *, why_none: str = "") -> Image:
    """Return metric depth from near (red) to far (blue), and why it is missing or reduced."""
    if depth is None:
        return empty_pane(f"no depth: {why_none}" if why_none else "no depth", size_px)
    known = np.isfinite(depth.depth)
    metres = np.where(known, depth.depth, 0.0)
    colours = _scale_colours()[np.clip(metres * (255.0 / FARTHEST_M), 0.0, 255.0).astype(np.uint8)]
    colours[~known] = _UNKNOWN
    image = canvas.resized(colours, size_px)
    words = "depth  nowhere known"
    if known.any():
        near_m, far_m = float(metres[known].min()), float(metres[known].max())
        words = f"depth  {near_m:.2f} to {far_m:.1f} m"
    if size_px[0] >= _ROOMY_PX:
        words += f",  confidence {depth.confidence:.2f}"
    canvas.tag(image, words, (10, 10), colour=DIM)
    if why_none:
        canvas.tag(image, why_none, (10, size_px[1] - 30), colour=ALARM)
    _draw_bar(image)
    return image


def _draw_bar(image: Image) -> None:
    height_px, width_px = image.shape[:2]
    top, bottom = 34, height_px - 14
    left = width_px - _BAR_WIDTH_PX - 34
    image[top - 10 : bottom + 10, left - 6 :] //= 4
    ramp = _scale_colours()[np.linspace(255, 0, bottom - top).astype(np.uint8)]
    image[top:bottom, left : left + _BAR_WIDTH_PX] = ramp[:, None, :]
    for metres in range(math.floor(FARTHEST_M) + 1):
        row = round(bottom - (bottom - top) * metres / FARTHEST_M)
        right = left + _BAR_WIDTH_PX
        canvas.line(image, [(right, row), (right + 3, row)], INK)
        canvas.put(image, f"{metres} m", (right + 5, row + 4), scale=0.32)


def intruding_pixels(intruding: Intruding | None, shown: Shown) -> NDArray[np.bool_] | None:
    """Return which pixels of a depth map are inside the corridor, (H, W).

    None if an input is missing, or the three have different capture times.
    """
    frame, class_map, depth = shown.frame, shown.class_map, shown.depth.value
    if intruding is None or frame is None or class_map is None or depth is None:
        return None
    together = depth.captured_s == class_map.captured_s == frame.captured_s
    return intruding(frame, class_map, depth) if together else None


def draw_corridor(
    shown: Image | None,
    corridor: Corridor | None,
    intruding: NDArray[np.bool_] | None,
    size_px: Size,
) -> Image:
    """Return the darkened image of a corridor with the pixels inside it marked, and text."""
    if shown is None or corridor is None:
        return empty_pane("no corridor", size_px)
    # Nearest neighbour takes a tenth of the time, and a darkened image looks the same.
    image = canvas.resized(shown, size_px) // 2
    if intruding is not None and intruding.any():
        whole = canvas.resized(intruding.view(np.uint8), size_px) > 0
        blended = (1.0 - _OPACITY) * image[whole] + _OPACITY * np.array(ALARM)
        image[whole] = blended.astype(np.uint8)
    colour = DIM if corridor.nearest_side is None else ALARM
    canvas.tag(image, describe_corridor(corridor), (10, 10), colour=colour)
    canvas.tag(image, describe_free(corridor), (10, size_px[1] - 30), colour=ACCENT)
    if size_px[0] >= _ROOMY_PX:
        row = size_px[1] // 2 - 10
        if math.isfinite(corridor.nearest_left_m):
            canvas.tag(image, f"< {corridor.nearest_left_m:.2f} m", (10, row), colour=ALARM)
        if math.isfinite(corridor.nearest_right_m):
            canvas.tag(
                image, f"{corridor.nearest_right_m:.2f} m >", (size_px[0], row), colour=ALARM
            )
    return image


def corridor_rows(reading: Reading[DepthMap], corridor: Corridor | None) -> list[Row]:
    """Return depth and corridor as rows of name, value and colour."""
    depth, age_s = reading.value, reading.age_s
    if depth is None:
        words = "none yet" if math.isinf(age_s) else f"none for {age_s:.1f} s"
        return [("depth", words, ALARM), ("inside", "unknown", ALARM)]
    first = ("depth", f"{age_s:.1f} s old, confidence {depth.confidence:.2f}", INK)
    if corridor is None:
        return [first, ("inside", "unknown", ALARM)]
    side = corridor.nearest_side
    inside = "nothing" if side is None else f"{side}, {corridor.nearest_m:.2f} m"
    return [
        first,
        ("inside", inside, INK if side is None else ALARM),
        ("ahead", _metres(corridor.free_distance_m), INK),
        ("left", _metres(corridor.nearest_left_m), INK),
        ("right", _metres(corridor.nearest_right_m), INK),
        ("unknown", f"{corridor.unknown_px} pixels of objects", INK),
    ]


def _metres(distance_m: float) -> str:
    return "free" if math.isinf(distance_m) else f"{distance_m:.2f} m"
