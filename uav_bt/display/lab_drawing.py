"""Drawing of a lab with axes in metres, names of the boxes, and the take-off pose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from uav_bt.display.canvas import (
    BACKDROP,
    DIM,
    INK,
    Colour,
    Point,
    circle,
    line,
    polygon,
    put,
    text_width_px,
)
from uav_bt.display.lab_map import HEADER_PX, LabMap, MapFrame, draw_lab, draw_movers
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Image

_SIDE_PX: Final = 64  # margin left and right of the ground, for the numbers of the y axis
_ABOVE_PX: Final = HEADER_PX + 24  # margin above the ground, for the title and the y axis
_BELOW_PX: Final = 72  # margin below the ground, for the numbers of the x axis and the legend
_TICK_PX: Final = 6
_TEXT: Final = 0.42  # scale of the axes' texts
_NAME: Final = 0.42  # scale of the names
_NAME_HIGH_PX: Final = 14  # height of a name
_PLACE_PX: Final = 5  # radius of the dot at a place
_PLACE_COLOUR: Final[Colour] = (255, 170, 0)
_ARROW_M: Final = 0.5  # least length of the arrow of the take-off heading
_ARROW_PX: Final = 44  # least length of the same arrow in a large lab
_BOXES: Final = "number in a box: height, m"
_TAKE_OFF: Final = "arrow: take-off heading"

_Rectangle = tuple[float, float, float, float]  # left, top, right, bottom, pixels


def draw_lab_with_axes(
    lab_map: LabMap, *, size_px: tuple[int, int] = (960, 780), title: str = ""
) -> Image:
    """Return a lab from above in the scene frame: x to the right, y up, metres.

    Args:
        lab_map: the content.
        size_px: width and height of the image.
        title: line of text at the top.

    Returns:
        (H, W, 3) uint8 RGB.

    Raises:
        ValueRangeError: the image is too small for the lab.
    """
    inner_px = (size_px[0] - 2 * _SIDE_PX, size_px[1])
    frame = replace(
        MapFrame.around(
            lab_map.ground_size_m, inner_px, 0.0, header_px=_ABOVE_PX, footer_px=_BELOW_PX
        ),
        size_px=size_px,
    )
    image = draw_lab(lab_map, frame)
    draw_movers(image, frame, lab_map)
    _draw_axes(image, frame, lab_map.ground_size_m)
    if lab_map.take_off is not None:
        _draw_take_off(image, frame, lab_map.take_off)
    for _, (x_m, y_m) in lab_map.places:
        polygon(image, circle(*frame.to_px(x_m, y_m), _PLACE_PX), _PLACE_COLOUR)
    _write_names(image, frame, lab_map)
    put(image, title, (14, 24), scale=0.55)
    legend = _BOXES if lab_map.take_off is None else f"{_BOXES}; {_TAKE_OFF}"
    put(image, legend, (14, size_px[1] - 12), colour=DIM, scale=_TEXT)
    return image


def _draw_axes(image: Image, frame: MapFrame, size_m: tuple[float, float]) -> None:
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    corners = [(-half_x, half_y), (-half_x, -half_y), (half_x, -half_y)]
    line(image, frame.all_to_px(corners), INK)
    left, base = (round(value) for value in frame.to_px(-half_x, -half_y))
    for x_m in _whole_metres(half_x):
        at = frame.to_px(x_m, -half_y)[0]
        line(image, [(at, base), (at, base + _TICK_PX)], INK)
        _put_centred(image, f"{x_m}", (at, base + 22))
    for y_m in _whole_metres(half_y):
        at = frame.to_px(-half_x, y_m)[1]
        line(image, [(left, at), (left - _TICK_PX, at)], INK)
        text = f"{y_m}"
        start = left - _TICK_PX - 6 - text_width_px(text, _TEXT)
        put(image, text, (start, round(at + 5)), scale=_TEXT)
    _put_centred(image, "x, m", (frame.to_px(0.0, 0.0)[0], base + 42))
    put(image, "y, m", (left - 58, round(frame.to_px(0.0, half_y)[1]) - 10), scale=_TEXT)


def _whole_metres(half_m: float) -> range:
    return range(-math.floor(half_m), math.floor(half_m) + 1)


def _put_centred(image: Image, text: str, at_px: Point) -> None:
    left = round(at_px[0] - text_width_px(text, _TEXT) / 2)
    put(image, text, (left, round(at_px[1])), scale=_TEXT)


def _draw_take_off(image: Image, frame: MapFrame, pose: Pose2D) -> None:
    long = _arrow_m(frame)
    half, tip, neck = 0.05 * long, 0.16 * long, 0.7 * long
    right = [(0.0, -half), (neck, -half), (neck, -tip), (long, 0.0)]
    outline = [*right, *((forward, -side) for forward, side in reversed(right[:-1]))]
    polygon(image, frame.all_to_px([pose.to_world(*point) for point in outline]), INK, BACKDROP)


def _arrow_m(frame: MapFrame) -> float:
    return max(_ARROW_M, _ARROW_PX / frame.scale_px_per_m)


def _write_names(image: Image, frame: MapFrame, lab_map: LabMap) -> None:
    """Write a name beside each object, on the ground and on no other object or name if possible."""
    named: list[tuple[str, Sequence[Point]]] = [(box.name, box.corners()) for box in lab_map.boxes]
    named += [
        (
            f"mover-{number}: {mover.item.name}, {mover.item.size_m[2]:.3g} m",
            mover.outline(mover.path_m[0]),
        )
        for number, mover in enumerate(lab_map.movers, start=1)
    ]
    if lab_map.mark is not None:
        pad = lab_map.mark
        named.append((f"mark, {pad.size_m[2]:.3g} m", pad.corners()))
    if lab_map.take_off is not None:
        pose = lab_map.take_off
        named.append(("take-off", [(pose.x_m, pose.y_m), pose.to_world(_arrow_m(frame), 0.0)]))
    named += [(text, [at_m]) for text, at_m in lab_map.places]
    taken = [_around(frame.all_to_px(outline_m)) for _, outline_m in named]
    half_x, half_y = (side_m / 2 for side_m in lab_map.ground_size_m)
    ground = _around(frame.all_to_px([(-half_x, -half_y), (half_x, half_y)]))
    for (name, _), item in zip(named, tuple(taken), strict=True):
        places = list(_beside(item, text_width_px(name, _NAME)))
        free = (
            place
            for place in places
            if _inside(place, ground) and not any(_overlap(place, other) for other in taken)
        )
        place = next(free, places[0])
        taken.append(place)
        at_px = (round(place[0]), round(place[3]) - 3)
        for shift in (-1, 1):  # a dark edge, readable on a path
            put(image, name, (at_px[0] + shift, at_px[1] + shift), colour=BACKDROP, scale=_NAME)
        put(image, name, at_px, scale=_NAME)


def _around(points_px: Sequence[Point]) -> _Rectangle:
    xs, ys = zip(*points_px, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _beside(item: _Rectangle, wide_px: int) -> Iterator[_Rectangle]:
    """Yield the places for a name of some width: below, above, right and left of an object."""
    left, top, right, bottom = item
    x, y = (left + right) / 2, (top + bottom) / 2
    gap, half, high = 3, wide_px / 2, _NAME_HIGH_PX
    yield x - half, bottom + gap, x + half, bottom + gap + high
    yield x - half, top - gap - high, x + half, top - gap
    yield right + gap, y - high / 2, right + gap + wide_px, y + high / 2
    yield left - gap - wide_px, y - high / 2, left - gap, y + high / 2


def _overlap(one: _Rectangle, other: _Rectangle) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _inside(one: _Rectangle, other: _Rectangle) -> bool:
    return other[0] <= one[0] and other[1] <= one[1] and one[2] <= other[2] and one[3] <= other[3]
