"""A lab from above: its objects, metres as pixels, and the map with axes and names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from uav_bt.display import canvas
from uav_bt.display.canvas import BACKDROP, DIM, INK, Colour, Point, Size
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.ground import Block, Footprint, Ground

GROUND_COLOUR: Final[Colour] = (52, 66, 54)
_GROUND_GRID: Final[Colour] = (63, 79, 65)
_FLOOR_GRID: Final[Colour] = (30, 33, 40)
_WHITE: Final[Colour] = (255, 255, 255)
_PLACE_COLOUR: Final[Colour] = (255, 170, 0)
HEADER_PX: Final = 32  # height of a map's title and scale
_SIDE_PX: Final = 64  # beside the ground, for the numbers
_BELOW_PX: Final = 72  # below the ground, for numbers and legend
_NAME_PX: Final = 16  # height of a name
_TEXT: Final = 0.42  # scale of axes and names
_ARROW_M: Final = 0.5  # length of the arrow of the take-off heading


@dataclass(frozen=True, kw_only=True)
class MapItem(Footprint):
    """An object, a mover or the mark, seen from above."""

    height_m: float
    colour: Colour = (160, 120, 80)  # RGB colour of the sides in class maps
    name: str = ""  # class of the sides, such as box_3
    parts: tuple[Block, ...] = ()  # of a table, say; none: it is solid
    path_m: tuple[Point, ...] = ()  # of a mover, world metres; a loop ends with its first point
    pieces_m: tuple[tuple[Point, ...], ...] = ()  # outlines of the pieces of a mesh, world metres
    # The top of a mark, RGB, upright; None: an H
    picture: Image | None = field(default=None, compare=False, repr=False)

    def corners(self) -> list[Point]:
        """Return the corners of the outline in world metres, counter-clockwise."""
        if self.round:
            return canvas.circle((self.x_m, self.y_m), self.half_x_m)
        return super().corners()

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance of a world point from the outline; 0 inside."""
        pieces = [np.array(piece_m, dtype=np.float32) for piece_m in self.pieces_m]
        inside_m = [cv2.pointPolygonTest(piece, (x_m, y_m), True) for piece in pieces]
        return max(-max(inside_m), 0.0) if pieces else super().distance_m(x_m, y_m)


@dataclass(frozen=True, kw_only=True)
class MapPlace:
    """A place that a mission names."""

    text: str  # as in the tree file
    at_m: Point | None  # in the drawing; None: known in flight only
    note: str = ""  # the room there
    fault: str = ""  # the line that names it and what to do, where there is too little room


@dataclass(frozen=True, kw_only=True)
class LabMap:
    """Content of a map of the lab; the origin is the middle of the ground."""

    ground: Ground
    boxes: tuple[MapItem, ...] = ()
    mark: MapItem | None = None
    movers: tuple[MapItem, ...] = ()  # at the start of their paths
    take_off: Pose2D | None = None  # None: random or unknown
    places: tuple[MapPlace, ...] = ()  # of a mission
    areas_m: tuple[tuple[Point, ...], ...] = ()  # polygons that it stays in


@dataclass(frozen=True, kw_only=True)
class MapFrame:
    """Conversion of world metres to pixels: x to the right, y up, one scale for both."""

    size_px: Size
    scale_px_per_m: float
    centre_m: Point = (0.0, 0.0)  # world point in the middle of the image

    @classmethod
    def around(
        cls, extent_m: Point, size_px: Size, margin_m: float = 0.2, *, above_px: int, below_px: int
    ) -> MapFrame:
        """Return the frame that shows an extent around the origin as large as possible.

        The space above it has the title, that below it the legend.
        """
        wide_m, high_m = (side + 2 * margin_m for side in extent_m)
        scale = min(size_px[0] / wide_m, (size_px[1] - above_px - below_px) / high_m)
        centre_m = (0.0, (above_px - below_px) / 2 / scale)
        return cls(size_px=size_px, scale_px_per_m=scale, centre_m=centre_m)

    def to_px(self, points_m: ArrayLike) -> Floats:
        """Return where world points, (..., 2), lie: pixels from the upper left corner."""
        off_px = (np.asarray(points_m) - self.centre_m) * self.scale_px_per_m
        return np.asarray(np.array(self.size_px) / 2 + off_px * (1, -1))


def draw_lab(lab_map: LabMap | None, frame: MapFrame) -> Image:
    """Return the empty lab; a grid of metres if it is unknown."""
    image = canvas.blank(frame.size_px, BACKDROP)
    reach_m = math.ceil(max(frame.size_px) / frame.scale_px_per_m / 2 + abs(frame.centre_m[1]))
    _grid(image, frame, (2.0 * reach_m, 2.0 * reach_m), _FLOOR_GRID)
    if lab_map is not None:
        canvas.polygon(image, frame.to_px(lab_map.ground.corners_m), GROUND_COLOUR)
        _grid(image, frame, lab_map.ground.size_m, _GROUND_GRID)
        if lab_map.mark is not None:
            _draw_mark(image, frame, lab_map.mark)
        for mover in lab_map.movers:
            canvas.line(image, frame.to_px(mover.path_m), _mixed(mover.colour, INK, 0.3))
        for box in lab_map.boxes:
            edge = _mixed(box.colour, INK, 0.45)
            for outline_m in box.pieces_m or (box.corners(),):
                canvas.polygon(image, frame.to_px(outline_m), box.colour, edge)
            scale = min(0.5, max(0.3, frame.scale_px_per_m / 220))
            x, y = frame.to_px((box.x_m, box.y_m))
            height = f"{box.height_m:.3g}"
            canvas.put_centred(image, height, (x, y + 11 * scale), scale=scale, colour=_WHITE)
    draw_scale(image, frame)
    return image


def _draw_mark(image: Image, frame: MapFrame, mark: MapItem) -> None:
    face = _mixed(mark.colour, BACKDROP, 0.35)
    canvas.polygon(image, frame.to_px(mark.corners()), face, mark.colour)
    if mark.picture is not None:
        corners_px = frame.to_px(mark.corners())[[1, 0, 2]].astype(np.float32)  # upper left first
        wide, high = np.ceil(np.linalg.norm(corners_px[1:] - corners_px[0], axis=1)).astype(int)
        small = cv2.resize(mark.picture, (int(wide), int(high)), interpolation=cv2.INTER_AREA)
        drawn = np.array([(0, 0), (wide, 0), (0, high)], dtype=np.float32)
        matrix, size_px = cv2.getAffineTransform(drawn, corners_px), frame.size_px
        cv2.warpAffine(small, matrix, size_px, image, borderMode=cv2.BORDER_TRANSPARENT)
        return
    a, b = 0.44 * mark.half_x_m, 0.56 * mark.half_y_m
    for stroke in (((-a, -b), (-a, b)), ((a, -b), (a, b)), ((-a, 0.0), (a, 0.0))):  # an H
        ends_m = [mark.to_world(*end) for end in stroke]
        stroke_px = max(2, round(0.05 * frame.scale_px_per_m))
        canvas.line(image, frame.to_px(ends_m), _WHITE, stroke_px)


def _grid(image: Image, frame: MapFrame, size_m: Point, colour: Colour) -> None:
    half_x, half_y = size_m[0] / 2, size_m[1] / 2
    for x in _whole_metres(half_x):
        canvas.line(image, frame.to_px([(x, -half_y), (x, half_y)]), colour)
    for y in _whole_metres(half_y):
        canvas.line(image, frame.to_px([(-half_x, y), (half_x, y)]), colour)


def _whole_metres(half_m: float) -> range:
    return range(-math.floor(half_m), math.floor(half_m) + 1)


def draw_movers(
    image: Image, frame: MapFrame, lab_map: LabMap, places_m: Sequence[Point] = ()
) -> None:
    """Draw the movers at places; by default at the start of their paths."""
    begins_m = [mover.path_m[0] for mover in lab_map.movers]
    for mover, (x_m, y_m) in zip(lab_map.movers, places_m or begins_m, strict=True):
        outline = frame.to_px(replace(mover, x_m=x_m, y_m=y_m).corners())
        canvas.polygon(image, outline, mover.colour, _mixed(mover.colour, INK, 0.7))


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


def draw_lab_with_axes(lab_map: LabMap, *, size_px: Size = (960, 780), title: str = "") -> Image:
    """Return a lab with names, take-off pose and metres."""
    inner_px = (size_px[0] - 2 * _SIDE_PX, size_px[1])
    margins = {"above_px": HEADER_PX + 24, "below_px": _BELOW_PX}
    frame = replace(
        MapFrame.around(lab_map.ground.size_m, inner_px, 0.0, **margins), size_px=size_px
    )
    image = draw_lab(lab_map, frame)
    draw_movers(image, frame, lab_map)
    _draw_axes(image, frame, lab_map.ground.size_m)
    legend = "number in a box: height, m"
    if lab_map.take_off is not None:
        ends_m = [lab_map.take_off.to_world(ahead_m, 0.0) for ahead_m in (0.0, _ARROW_M)]
        tail, tip = np.rint(frame.to_px(ends_m)).astype(int)
        cv2.arrowedLine(image, tail, tip, INK, 3, cv2.LINE_AA, tipLength=0.3)
        legend += "; arrow: take-off heading"
    for polygon_m in lab_map.areas_m:
        canvas.polygon(image, frame.to_px(polygon_m), None, _PLACE_COLOUR)
    legend += "; outline: area of the mission" if lab_map.areas_m else ""
    for place in lab_map.places:
        if place.at_m is not None:
            colour = canvas.ALARM if place.fault else _PLACE_COLOUR
            canvas.polygon(image, canvas.circle(frame.to_px(place.at_m), 5), colour)
    _write_names(image, frame, lab_map)
    canvas.put(image, title, (14, 24), scale=0.55)
    canvas.put(image, legend, (14, size_px[1] - 12), colour=DIM, scale=_TEXT)
    return image


def _draw_axes(image: Image, frame: MapFrame, size_m: Point) -> None:
    """Write the metres of the grid's lines below and left of the ground."""
    left, base = frame.to_px((-size_m[0] / 2, -size_m[1] / 2))
    for x_m in _whole_metres(size_m[0] / 2):
        canvas.put_centred(image, f"{x_m}", (frame.to_px((x_m, 0.0))[0], base + 18))
    for y_m in _whole_metres(size_m[1] / 2):
        canvas.put_centred(image, f"{y_m}", (left - 16, frame.to_px((0.0, y_m))[1] + 5))
    canvas.put_centred(image, "x, m", (frame.size_px[0] / 2, base + 38))
    canvas.put_centred(image, "y, m", (left - 40, frame.size_px[1] / 2))


def _write_names(image: Image, frame: MapFrame, lab_map: LabMap) -> None:
    """Write a name below each object, and above those at the ground's lower edge."""
    lowest = frame.to_px((0.0, -lab_map.ground.size_m[1] / 2))[1]
    named = [(box.name, box.corners()) for box in lab_map.boxes]
    for number, mover in enumerate(lab_map.movers, start=1):
        named.append((f"mover-{number}: {mover.name}, {mover.height_m:.3g} m", mover.corners()))
    if lab_map.mark is not None:
        named.append((f"mark, {lab_map.mark.height_m:.3g} m", lab_map.mark.corners()))
    bad = {f"{each.text}: {each.note}" for each in lab_map.places if each.fault}
    for each in lab_map.places:
        words = f"{each.text}: {each.note}" if each.fault else each.text
        named += [] if each.at_m is None else [(words, [each.at_m])]
    for name, outline_m in named:
        outline_px = frame.to_px(outline_m)
        (left, top), (right, bottom) = outline_px.min(axis=0), outline_px.max(axis=0)
        side = canvas.text_width_px(name, _TEXT) / 2 + 4
        middle = min(max((left + right) / 2, side), max(frame.size_px[0] - side, side))
        base = bottom + _NAME_PX
        if base > lowest:
            base = top - 5
        # A dark edge keeps it readable on a path.
        canvas.put_centred(image, name, (middle + 1, base + 1), colour=BACKDROP)
        colour = canvas.ALARM if name in bad else INK
        canvas.put_centred(image, name, (middle, base), colour=colour)
