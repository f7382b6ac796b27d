"""Panes of metric depth and of the corridor."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.display.canvas import ACCENT, ALARM, DIM, INK, PANEL, Colour, line, put, tag
from uav_bt.display.canvas import text_width_px as wide_px
from uav_bt.display.phrases import describe_corridor, describe_free
from uav_bt.types import ClassMap, Corridor, DepthMap, Frame
from uav_bt.types.arrays import Image

Intruding = Callable[[Frame, ClassMap, DepthMap], NDArray[np.bool_]]
"""Returns which pixels of a depth map are inside the corridor, (H, W)."""

FARTHEST_M: Final = 5.0  # end of the scale: the length of the paper's carpet
_UNKNOWN: Final[Colour] = (70, 74, 84)  # grey, which is not in the scale
_BAR_WIDTH_PX: Final = 10
_OPACITY: Final = 0.6  # opacity of the mark on intruding pixels


@functools.cache
def _scale_colours() -> NDArray[np.uint8]:
    """Return (256, 3) RGB from near (red) to far (blue)."""
    ramp = np.arange(255, -1, -1, dtype=np.uint8).reshape(-1, 1)
    return np.asarray(cv2.applyColorMap(ramp, cv2.COLORMAP_TURBO)[:, 0, ::-1], dtype=np.uint8)


@functools.cache
def _panel(size_px: tuple[int, int]) -> Image:
    """Return the empty pane, cached because filling takes ten times as long as copying."""
    return np.full((size_px[1], size_px[0], 3), PANEL, dtype=np.uint8)


def empty_pane(words: str, size_px: tuple[int, int]) -> Image:
    """Return a pane with only a line of text."""
    image = _panel(size_px).copy()
    scale = 0.5
    while wide_px(words, scale) > size_px[0] - 16 and scale > 0.3:
        scale -= 0.05
    put(image, words, ((size_px[0] - wide_px(words, scale)) // 2, size_px[1] // 2), scale=scale)
    return image


def draw_depth(
    depth: DepthMap | None,
    size_px: tuple[int, int],
    *,
    why_none: str = "",
    farthest_m: float = FARTHEST_M,
) -> Image:
    """Return metric depth as colours from near (red) to far (blue), with a scale in metres.

    Args:
        depth: metric depth; None draws an empty pane.
        size_px: width and height of the pane.
        why_none: reason why depth is missing or reduced.
        farthest_m: end of the scale; farther pixels have its colour.
    """
    if depth is None:
        return empty_pane(f"no depth: {why_none}" if why_none else "no depth", size_px)
    known = np.isfinite(depth.depth)
    metres = np.where(known, depth.depth, 0.0)
    places = np.clip(metres * (255.0 / farthest_m), 0.0, 255.0).astype(np.uint8)
    colours = _scale_colours()[places]
    colours[~known] = _UNKNOWN
    image: Image = np.asarray(
        cv2.resize(colours, size_px, interpolation=cv2.INTER_NEAREST), dtype=np.uint8
    )
    if known.any():
        near_m, far_m = float(metres[known].min()), float(metres[known].max())
        words = f"depth  {near_m:.2f} to {far_m:.1f} m"
    else:
        words = "depth  nowhere known"
    if size_px[0] >= 400:
        words += f",  confidence {depth.confidence:.2f}"
    tag(image, words, (10, 10), colour=DIM)
    if why_none:
        tag(image, why_none, (10, size_px[1] - 30), colour=ALARM)
    _draw_bar(image, farthest_m)
    return image


def _draw_bar(image: Image, farthest_m: float) -> None:
    height_px, width_px = image.shape[:2]
    top, bottom = 34, height_px - 14
    left = width_px - _BAR_WIDTH_PX - 34
    image[top - 10 : bottom + 10, left - 6 :] //= 4
    ramp = _scale_colours()[np.linspace(255, 0, bottom - top).astype(np.uint8)]
    image[top:bottom, left : left + _BAR_WIDTH_PX] = ramp[:, None, :]
    for metres in range(math.floor(farthest_m) + 1):
        row = round(bottom - (bottom - top) * metres / farthest_m)
        right = left + _BAR_WIDTH_PX
        line(image, [(right, row), (right + 3, row)], INK)
        put(image, f"{metres} m", (right + 5, row + 4), scale=0.32)


def intruding_pixels(
    intruding: Intruding | None,
    frame: Frame | None,
    class_map: ClassMap | None,
    depth: DepthMap | None,
) -> NDArray[np.bool_] | None:
    """Return which pixels of a depth map are inside the corridor, (H, W).

    Args:
        intruding: finds the pixels.
        frame: newest frame.
        class_map: newest class map.
        depth: newest metric depth.

    Returns:
        None if an input is missing, or the three have different capture times.
    """
    if intruding is None or frame is None or class_map is None or depth is None:
        return None
    together = depth.captured_s == class_map.captured_s == frame.captured_s
    return intruding(frame, class_map, depth) if together else None


def draw_corridor(
    shown: Image | None,
    corridor: Corridor | None,
    intruding: NDArray[np.bool_] | None,
    size_px: tuple[int, int],
) -> Image:
    """Return the darkened image with the pixels inside the corridor marked, and text.

    Args:
        shown: image (H, W, 3) RGB, of any size.
        corridor: corridor of that image; None draws an empty pane.
        intruding: (h, w) pixels inside the corridor, of any size; None marks no pixels.
        size_px: width and height of the pane.
    """
    if shown is None or corridor is None:
        return empty_pane("no corridor", size_px)
    # Nearest neighbour takes a tenth of the time, and a darkened image looks the same.
    image: Image = np.asarray(
        cv2.resize(shown, size_px, interpolation=cv2.INTER_NEAREST) // 2, dtype=np.uint8
    )
    if intruding is not None and intruding.any():
        whole = cv2.resize(intruding.view(np.uint8), size_px, interpolation=cv2.INTER_NEAREST) > 0
        blended = (1.0 - _OPACITY) * image[whole] + _OPACITY * np.array(ALARM)
        image[whole] = blended.astype(np.uint8)
    colour = DIM if corridor.nearest_side is None else ALARM
    tag(image, describe_corridor(corridor), (10, 10), colour=colour)
    tag(image, describe_free(corridor), (10, size_px[1] - 30), colour=ACCENT)
    if size_px[0] >= 400:
        _draw_sides(image, corridor)
    return image


def _draw_sides(image: Image, corridor: Corridor) -> None:
    height_px, width_px = image.shape[:2]
    row = height_px // 2 - 10
    if math.isfinite(corridor.nearest_left_m):
        tag(image, f"< {corridor.nearest_left_m:.2f} m", (10, row), colour=ALARM)
    if math.isfinite(corridor.nearest_right_m):
        tag(image, f"{corridor.nearest_right_m:.2f} m >", (width_px, row), colour=ALARM)


def corridor_rows(
    depth: DepthMap | None, corridor: Corridor | None, age_s: float
) -> Sequence[tuple[str, str, Colour]]:
    """Return depth and corridor as rows of name, value and colour.

    Args:
        depth: fresh metric depth, or None.
        corridor: fresh corridor, or None.
        age_s: age of the last metric depth; inf before the first.
    """
    if depth is None:
        words = "none yet" if math.isinf(age_s) else f"none for {age_s:.1f} s"
        return [("depth", words, ALARM), ("inside", "unknown", ALARM)]
    rows: list[tuple[str, str, Colour]] = [
        ("depth", f"{age_s:.1f} s old, confidence {depth.confidence:.2f}", INK)
    ]
    if corridor is None:
        return [*rows, ("inside", "unknown", ALARM)]
    side = corridor.nearest_side
    inside = "nothing" if side is None else f"{side}, {corridor.nearest_m:.2f} m"
    return [
        *rows,
        ("inside", inside, INK if side is None else ALARM),
        ("ahead", _metres(corridor.free_distance_m), INK),
        ("left", _metres(corridor.nearest_left_m), INK),
        ("right", _metres(corridor.nearest_right_m), INK),
        ("unknown", f"{corridor.unknown_px} pixels of objects", INK),
    ]


def _metres(distance_m: float) -> str:
    return "free" if math.isinf(distance_m) else f"{distance_m:.2f} m"
