"""Drawings of a lab from above: the ground of the film's map, and a map with axes and names."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from uav_bt.display import canvas
from uav_bt.display.canvas import BACKDROP, DIM, INK, Colour, Point, Size
from uav_bt.display.lab_map import LabMap, MapFrame
from uav_bt.types.arrays import Image

GROUND_COLOUR: Final[Colour] = (52, 66, 54)
_GROUND_GRID: Final[Colour] = (63, 79, 65)
_FLOOR_GRID: Final[Colour] = (30, 33, 40)
_WHITE: Final[Colour] = (255, 255, 255)
_PLACE_COLOUR: Final[Colour] = (255, 170, 0)
HEADER_PX: Final = 32  # height of a map's title and scale
_LEGEND_LEFT_PX: Final = 18
_SIDE_PX: Final = 64  # margin left and right of the ground, for the numbers of the y axis
_BELOW_PX: Final = 72  # margin below the ground, for the numbers of the x axis and the legend
_TICK_PX: Final = 6
_NAME_HIGH_PX: Final = 14
_TEXT: Final = 0.42  # scale of axes and names
_ARROW_M: Final = 0.5  # least length of the arrow of the take-off heading
_ARROW_PX: Final = 44  # least length of the same arrow in a large lab

_Rectangle = tuple[float, float, float, float]  # left, top, right, bottom, pixels


def draw_lab(lab_map: LabMap | None, frame: MapFrame) -> Image:
    """Return the empty lab: ground, boxes, mark, movers' paths; a grid of metres if unknown."""
    image = canvas.blank(frame.size_px, BACKDROP)
    reach_m = math.ceil(max(frame.size_px) / frame.scale_px_per_m / 2 + abs(frame.centre_m[1]))
    _grid(image, frame, (2.0 * reach_m, 2.0 * reach_m), _FLOOR_GRID)
    if lab_map is not None:
        canvas.polygon(image, frame.all_to_px(lab_map.outline()), GROUND_COLOUR)
        _grid(image, frame, lab_map.ground_size_m, _GROUND_GRID)
        if lab_map.mark is not None:
            pad, face = lab_map.mark, _mixed(lab_map.mark.colour, BACKDROP, 0.35)
            canvas.polygon(image, frame.all_to_px(pad.corners()), face, pad.colour)
            for stroke in pad.letter():
                stroke_px = max(2, round(0.05 * frame.scale_px_per_m))
                canvas.line(image, frame.all_to_px(stroke), _WHITE, stroke_px)
        for mover in lab_map.movers:
            canvas.line(image, frame.all_to_px(mover.path_m), _mixed(mover.item.colour, INK, 0.3))
        for box in lab_map.boxes:
            edge = _mixed(box.colour, INK, 0.45)
            canvas.polygon(image, frame.all_to_px(box.corners()), box.colour, edge)
            scale = min(0.5, max(0.3, frame.scale_px_per_m / 220))
            x, y = frame.to_px(box.x_m, box.y_m)
            height = f"{box.size_m[2]:.3g}"
            canvas.put_centred(image, height, (x, y + 11 * scale), scale=scale, colour=_WHITE)
    draw_scale(image, frame)
    return image


def _grid(image: Image, frame: MapFrame, size_m: tuple[float, float], colour: Colour) -> None:
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    for x in _whole_metres(half_x):
        canvas.line(image, frame.all_to_px([(x, -half_y), (x, half_y)]), colour)
    for y in _whole_metres(half_y):
        canvas.line(image, frame.all_to_px([(-half_x, y), (half_x, y)]), colour)


def _whole_metres(half_m: float) -> range:
    return range(-math.floor(half_m), math.floor(half_m) + 1)


def draw_movers(
    image: Image, frame: MapFrame, lab_map: LabMap, places_m: Sequence[Point] = ()
) -> None:
    """Draw the movers at places in the map's order; by default at the start of their paths."""
    begins = [mover.path_m[0] for mover in lab_map.movers]
    for mover, at_m in zip(lab_map.movers, places_m or begins, strict=True):
        edge = _mixed(mover.item.colour, INK, 0.7)
        canvas.polygon(image, frame.all_to_px(mover.at(at_m).corners()), mover.item.colour, edge)


def draw_scale(image: Image, frame: MapFrame) -> None:
    """Draw a scale of one metre at the top right."""
    right, base = frame.size_px[0] - 12, 22  # beside the title, above the map
    left = right - frame.scale_px_per_m
    canvas.line(image, [(left, base - 4), (left, base), (right, base), (right, base - 4)], DIM)
    canvas.put(image, "1 m", (round(left) - 28, base), colour=DIM, scale=0.38)


def _mixed(one: Colour, other: Colour, share: float) -> Colour:
    """Return `one` with a share of `other`."""
    red, green, blue = (round((1 - share) * a + share * b) for a, b in zip(one, other, strict=True))
    return red, green, blue


def draw_legend(image: Image, colours: Mapping[str, Colour], *, base_px: int) -> None:
    """Write phases in their colours in one row; if not all fit, only the last ones."""
    entries = [
        (phase, colour, 20 + canvas.text_width_px(phase, _TEXT) + 16)
        for phase, colour in colours.items()
        if phase
    ]
    room_px = image.shape[1] - 2 * _LEGEND_LEFT_PX
    while sum(wide_px for *_, wide_px in entries) > room_px and len(entries) > 1:
        entries.pop(0)
    left = _LEGEND_LEFT_PX
    for phase, colour, wide_px in entries:
        canvas.line(image, [(left, base_px - 4), (left + 14, base_px - 4)], colour, 3)
        canvas.put(image, phase, (left + 20, base_px), scale=_TEXT)
        left += wide_px


def draw_lab_with_axes(lab_map: LabMap, *, size_px: Size = (960, 780), title: str = "") -> Image:
    """Return a lab with axes in metres, names and the take-off pose: x to the right, y up."""
    inner_px = (size_px[0] - 2 * _SIDE_PX, size_px[1])
    margins = {"header_px": HEADER_PX + 24, "footer_px": _BELOW_PX}
    inner = MapFrame.around(lab_map.ground_size_m, inner_px, 0.0, **margins)
    frame = replace(inner, size_px=size_px)
    image = draw_lab(lab_map, frame)
    draw_movers(image, frame, lab_map)
    _draw_axes(image, frame, lab_map.ground_size_m)
    legend = "number in a box: height, m"
    if lab_map.take_off is not None:
        arrow = [lab_map.take_off.to_world(*point) for point in _arrow(frame)]
        canvas.polygon(image, frame.all_to_px(arrow), INK, BACKDROP)
        legend += "; arrow: take-off heading"
    for _, (x_m, y_m) in lab_map.places:
        canvas.polygon(image, canvas.circle(*frame.to_px(x_m, y_m), 5), _PLACE_COLOUR)
    _write_names(image, frame, lab_map)
    canvas.put(image, title, (14, 24), scale=0.55)
    canvas.put(image, legend, (14, size_px[1] - 12), colour=DIM, scale=_TEXT)
    return image


def _draw_axes(image: Image, frame: MapFrame, size_m: tuple[float, float]) -> None:
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    corners = [(-half_x, half_y), (-half_x, -half_y), (half_x, -half_y)]
    canvas.line(image, frame.all_to_px(corners), INK)
    left, base = (round(value) for value in frame.to_px(-half_x, -half_y))
    for x_m in _whole_metres(half_x):
        at = frame.to_px(x_m, -half_y)[0]
        canvas.line(image, [(at, base), (at, base + _TICK_PX)], INK)
        canvas.put_centred(image, f"{x_m}", (at, base + 22))
    for y_m in _whole_metres(half_y):
        at = frame.to_px(-half_x, y_m)[1]
        canvas.line(image, [(left, at), (left - _TICK_PX, at)], INK)
        start = left - _TICK_PX - 6 - canvas.text_width_px(f"{y_m}", _TEXT)
        canvas.put(image, f"{y_m}", (start, round(at + 5)), scale=_TEXT)
    canvas.put_centred(image, "x, m", (frame.to_px(0.0, 0.0)[0], base + 42))
    canvas.put(image, "y, m", (left - 58, round(frame.to_px(0.0, half_y)[1]) - 10), scale=_TEXT)


def _arrow(frame: MapFrame) -> list[Point]:
    """Return the outline of the take-off arrow, forward and left of the pose; its tip is third."""
    long = max(_ARROW_M, _ARROW_PX / frame.scale_px_per_m)
    half, tip, neck = 0.05 * long, 0.16 * long, 0.7 * long
    right = [(0.0, -half), (neck, -half), (neck, -tip)]
    return [*right, (long, 0.0), *((forward, -side) for forward, side in reversed(right))]


def _write_names(image: Image, frame: MapFrame, lab_map: LabMap) -> None:
    """Write a name beside each object, on the ground and on no other object or name if possible."""
    named: list[tuple[str, Sequence[Point]]] = [(box.name, box.corners()) for box in lab_map.boxes]
    for number, mover in enumerate(lab_map.movers, start=1):
        item = mover.at(mover.path_m[0])
        named.append((f"mover-{number}: {item.name}, {item.size_m[2]:.3g} m", item.corners()))
    if lab_map.mark is not None:
        named.append((f"mark, {lab_map.mark.size_m[2]:.3g} m", lab_map.mark.corners()))
    if lab_map.take_off is not None:
        pose = lab_map.take_off
        named.append(("take-off", [(pose.x_m, pose.y_m), pose.to_world(*_arrow(frame)[3])]))
    named += [(text, [at_m]) for text, at_m in lab_map.places]
    taken = [_around(frame.all_to_px(outline_m)) for _, outline_m in named]
    half_x, half_y = (side_m / 2 for side_m in lab_map.ground_size_m)
    ground = _around(frame.all_to_px([(-half_x, -half_y), (half_x, half_y)]))
    for (name, _), (left, top, right, bottom) in zip(named, tuple(taken), strict=True):
        wide, high = canvas.text_width_px(name, _TEXT), _NAME_HIGH_PX
        x, y = (left + right - wide) / 2, (top + bottom - high) / 2
        below, above = (x, bottom + 3), (x, top - 3 - high)
        corners = (below, above, (right + 3, y), (left - 3 - wide, y))
        places = [(x, y, x + wide, y + high) for x, y in corners]
        place = next((one for one in places if _is_free(one, ground, taken)), places[0])
        taken.append(place)
        x, y = round(place[0]), round(place[3]) - 3
        for shift in (-1, 1):  # a dark edge, readable on a path
            canvas.put(image, name, (x + shift, y + shift), colour=BACKDROP, scale=_TEXT)
        canvas.put(image, name, (x, y), scale=_TEXT)


def _around(points_px: Sequence[Point]) -> _Rectangle:
    xs, ys = zip(*points_px, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _is_free(one: _Rectangle, ground: _Rectangle, taken: Sequence[_Rectangle]) -> bool:
    left, top, right, bottom = one
    inside = ground[0] <= left and ground[1] <= top and right <= ground[2] and bottom <= ground[3]
    return inside and not any(
        left < other[2] and other[0] < right and top < other[3] and other[1] < bottom
        for other in taken
    )
