"""Map of the lab from above: its objects, conversion of metres to pixels, and drawing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

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
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.ground import Block, Ground

GROUND_COLOUR: Final[Colour] = (52, 66, 54)
_GROUND_GRID: Final[Colour] = (63, 79, 65)
_FLOOR_GRID: Final[Colour] = (30, 33, 40)
HEADER_PX: Final = 32  # height of a map's title and scale
_LEGEND_LEFT_PX: Final = 18
_UNNAMED: Final[Colour] = (150, 156, 166)  # colour before the first phase
# Bright and distinct colours, used in the order in which phases appear.
_PHASE_COLOURS: Final[tuple[Colour, ...]] = (
    (170, 178, 190),
    (94, 205, 255),
    (255, 130, 190),
    (255, 170, 80),
    (178, 235, 110),
    (255, 255, 255),
    (190, 160, 255),
)


@dataclass(frozen=True, kw_only=True)
class MapItem(Pose2D):
    """An object or the mark, seen from above."""

    size_m: tuple[float, float, float]  # along the object's x and y, and its height
    yaw_rad: float = 0.0  # counter-clockwise from +x
    colour: Colour = (160, 120, 80)  # RGB colour of the sides in class maps
    name: str = ""  # class of the sides, such as box_3
    round: bool = False  # whether it is a cylinder
    base_m: float = 0.0  # height of its underside
    parts: tuple[Block, ...] = ()  # such as the legs and the top of a table; none: it is solid

    def corners(self) -> list[Point]:
        """Return the corners of the outline in world metres, counter-clockwise."""
        if self.round:
            return circle(self.x_m, self.y_m, self.size_m[0] / 2)
        return self.rectangle(self.size_m[0] / 2, self.size_m[1] / 2)

    def letter(self) -> list[list[Point]]:
        """Return the strokes of a mark's H in world metres."""
        a, b = 0.22 * self.size_m[0], 0.28 * self.size_m[1]
        strokes = (((-a, -b), (-a, b)), ((a, -b), (a, b)), ((-a, 0.0), (a, 0.0)))
        return [[self.to_world(*end) for end in stroke] for stroke in strokes]


@dataclass(frozen=True, kw_only=True)
class MapMover:
    """A mover with its path."""

    item: MapItem
    path_m: tuple[Point, ...]  # world metres; a loop ends with its first point
    round: bool = False  # whether the mover is a cylinder

    def outline(self, at_m: Point) -> list[Point]:
        """Return the outline in world metres around a centre."""
        if self.round:
            return circle(*at_m, self.item.size_m[0] / 2)
        return replace(self.item, x_m=at_m[0], y_m=at_m[1]).corners()


@dataclass(frozen=True, kw_only=True)
class LabMap:
    """Content of a map of the lab; the origin is the middle of the ground."""

    ground_size_m: tuple[float, float]  # along world x and y
    boxes: tuple[MapItem, ...] = ()
    mark: MapItem | None = None
    movers: tuple[MapMover, ...] = ()
    take_off: Pose2D | None = None  # None: random or unknown
    places: tuple[tuple[str, Point], ...] = ()  # of a mission: text in the tree, and position
    ground: Ground | None = None  # with the objects' parts; None: the ground with solid boxes

    def __post_init__(self) -> None:
        if min(self.ground_size_m) <= 0.0:
            raise ValueRangeError(f"the ground must have a size, got {self.ground_size_m} m")

    def outline(self) -> list[Point]:
        """Return the corners of the ground in world metres."""
        ground = self.ground or Ground(size_m=self.ground_size_m)
        return list(ground.corners_m)


@dataclass(frozen=True, kw_only=True)
class MapFrame:
    """Conversion of world metres to pixels: x to the right, y up, one scale for both."""

    size_px: tuple[int, int]  # width, height
    scale_px_per_m: float
    centre_m: Point = (0.0, 0.0)  # world point in the middle of the image

    @classmethod
    def around(
        cls,
        extent_m: tuple[float, float],
        size_px: tuple[int, int],
        margin_m: float = 0.2,
        *,
        header_px: int = 0,
        footer_px: int = 0,
    ) -> MapFrame:
        """Return the frame that shows an extent around the origin as large as possible.

        Args:
            extent_m: size along world x and y.
            size_px: width and height of the image.
            margin_m: margin on each side of the extent.
            header_px: height of the title above the extent.
            footer_px: height of the legend below the extent.

        Raises:
            ValueRangeError: the image is too small for the extent.
        """
        wide_m, high_m = (side + 2 * margin_m for side in extent_m)
        wide_px, high_px = size_px[0], size_px[1] - header_px - footer_px
        if min(wide_m, high_m, wide_px, high_px) <= 0.0:
            raise ValueRangeError(f"cannot show {extent_m} m in {size_px} pixels")
        scale = min(wide_px / wide_m, high_px / high_m)
        centre_m = (0.0, (header_px - footer_px) / 2 / scale)
        return cls(size_px=size_px, scale_px_per_m=scale, centre_m=centre_m)

    def to_px(self, x_m: float, y_m: float) -> Point:
        """Return the position of a world point, pixels from the upper left corner."""
        return (
            self.size_px[0] / 2 + (x_m - self.centre_m[0]) * self.scale_px_per_m,
            self.size_px[1] / 2 - (y_m - self.centre_m[1]) * self.scale_px_per_m,
        )

    def all_to_px(self, points_m: Sequence[Point]) -> list[Point]:
        """Return the positions of world points, pixels."""
        return [self.to_px(x, y) for x, y in points_m]


def phase_colours(phases: Sequence[str]) -> dict[str, Colour]:
    """Return a colour for each phase, in the order of first appearance."""
    named = [phase for phase in dict.fromkeys(phases) if phase]
    colours = {p: _PHASE_COLOURS[i % len(_PHASE_COLOURS)] for i, p in enumerate(named)}
    return {"": _UNNAMED, **colours}


def draw_lab(lab_map: LabMap | None, frame: MapFrame) -> Image:
    """Return the empty lab: floor, ground with a grid of metres, boxes, mark, movers' paths.

    Args:
        lab_map: the content; None draws only the grid.
        frame: conversion of world metres to pixels.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    width_px, height_px = frame.size_px
    image: Image = np.full((height_px, width_px, 3), BACKDROP, dtype=np.uint8)
    reach_m = math.ceil(max(frame.size_px) / frame.scale_px_per_m / 2 + abs(frame.centre_m[1]))
    _grid(image, frame, (2.0 * reach_m, 2.0 * reach_m), _FLOOR_GRID)
    if lab_map is not None:
        polygon(image, frame.all_to_px(lab_map.outline()), GROUND_COLOUR)
        _grid(image, frame, lab_map.ground_size_m, _GROUND_GRID)
        if lab_map.mark is not None:
            _draw_mark(image, frame, lab_map.mark)
        for mover in lab_map.movers:
            line(image, frame.all_to_px(mover.path_m), _mixed(mover.item.colour, INK, 0.3))
        for box in lab_map.boxes:
            _draw_box(image, frame, box)
    draw_scale(image, frame)
    return image


def _grid(image: Image, frame: MapFrame, size_m: tuple[float, float], colour: Colour) -> None:
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    for x in range(-math.floor(half_x), math.floor(half_x) + 1):
        line(image, frame.all_to_px([(x, -half_y), (x, half_y)]), colour)
    for y in range(-math.floor(half_y), math.floor(half_y) + 1):
        line(image, frame.all_to_px([(-half_x, y), (half_x, y)]), colour)


def _draw_box(image: Image, frame: MapFrame, box: MapItem) -> None:
    edge = _mixed(box.colour, INK, 0.45)
    polygon(image, frame.all_to_px(box.corners()), box.colour, edge)
    _label(image, frame, box, f"{box.size_m[2]:.3g}")


def draw_movers(
    image: Image, frame: MapFrame, lab_map: LabMap, places_m: Sequence[Point] = ()
) -> None:
    """Draw the movers at places in the map's order; by default at the start of their paths."""
    begins = [mover.path_m[0] for mover in lab_map.movers]
    for mover, at_m in zip(lab_map.movers, places_m or begins, strict=True):
        edge = _mixed(mover.item.colour, INK, 0.7)
        polygon(image, frame.all_to_px(mover.outline(at_m)), mover.item.colour, edge)


def _draw_mark(image: Image, frame: MapFrame, pad: MapItem) -> None:
    polygon(image, frame.all_to_px(pad.corners()), _mixed(pad.colour, BACKDROP, 0.35), pad.colour)
    stroke_px = max(2, round(0.05 * frame.scale_px_per_m))
    for stroke in pad.letter():
        line(image, frame.all_to_px(stroke), (255, 255, 255), stroke_px)


def _label(image: Image, frame: MapFrame, item: MapItem, text: str) -> None:
    scale = min(0.5, max(0.3, frame.scale_px_per_m / 220))
    x, y = frame.to_px(item.x_m, item.y_m)
    left = round(x - text_width_px(text, scale) / 2)
    put(image, text, (left, round(y + 11 * scale)), scale=scale, colour=(255, 255, 255))


def draw_scale(image: Image, frame: MapFrame) -> None:
    """Draw a scale of one metre at the top right."""
    right, base = frame.size_px[0] - 12, 22  # beside the title, above the map
    left = right - frame.scale_px_per_m
    line(image, [(left, base - 4), (left, base), (right, base), (right, base - 4)], DIM)
    put(image, "1 m", (round(left) - 28, base), colour=DIM, scale=0.38)


def _mixed(one: Colour, other: Colour, share: float) -> Colour:
    """Return `one` with a share of `other`."""
    red, green, blue = (round((1 - share) * a + share * b) for a, b in zip(one, other, strict=True))
    return red, green, blue


def draw_legend(image: Image, colours: Mapping[str, Colour], *, base_px: int) -> None:
    """Write the phases in their colours in one row.

    Args:
        image: the image to draw on.
        colours: colours by phase; if not all fit, only the last ones are written.
        base_px: row of the baseline.
    """
    entries = [
        (phase, colour, 20 + text_width_px(phase, 0.42) + 16)
        for phase, colour in colours.items()
        if phase
    ]
    room_px = image.shape[1] - 2 * _LEGEND_LEFT_PX
    while sum(wide_px for *_, wide_px in entries) > room_px and len(entries) > 1:
        entries.pop(0)
    left = _LEGEND_LEFT_PX
    for phase, colour, wide_px in entries:
        line(image, [(left, base_px - 4), (left + 14, base_px - 4)], colour, 3)
        put(image, phase, (left + 20, base_px), colour=INK, scale=0.42)
        left += wide_px
