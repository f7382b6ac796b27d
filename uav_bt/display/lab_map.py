"""A lab from above: its objects, and the conversion of metres to pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

from uav_bt.display.canvas import Colour, Point, Size, circle
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.ground import Block, Ground

Number = TypeVar("Number", float, Floats)

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


def phase_colours(phases: Sequence[str]) -> dict[str, Colour]:
    """Return a colour for each phase, in the order of first appearance."""
    named = [phase for phase in dict.fromkeys(phases) if phase]
    colours = {p: _PHASE_COLOURS[i % len(_PHASE_COLOURS)] for i, p in enumerate(named)}
    return {"": _UNNAMED, **colours}


@dataclass(frozen=True, kw_only=True)
class MapItem(Pose2D):
    """An object or the mark, seen from above."""

    size_m: tuple[float, float, float]  # along the object's x and y, and its height
    yaw_rad: float = 0.0  # counter-clockwise from +x
    colour: Colour = (160, 120, 80)  # RGB colour of the sides in class maps
    name: str = ""  # class of the sides, such as box_3
    round: bool = False  # whether it is a cylinder
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

    def at(self, place_m: Point) -> MapItem:
        """Return the mover at a place."""
        return replace(self.item, x_m=place_m[0], y_m=place_m[1])


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

    def outline(self) -> list[Point]:
        """Return the corners of the ground in world metres."""
        ground = self.ground or Ground(size_m=self.ground_size_m)
        return list(ground.corners_m)


@dataclass(frozen=True, kw_only=True)
class MapFrame:
    """Conversion of world metres to pixels: x to the right, y up, one scale for both."""

    size_px: Size
    scale_px_per_m: float
    centre_m: Point = (0.0, 0.0)  # world point in the middle of the image

    @classmethod
    def around(
        cls,
        extent_m: tuple[float, float],
        size_px: Size,
        margin_m: float = 0.2,
        *,
        header_px: int = 0,
        footer_px: int = 0,
    ) -> MapFrame:
        """Return the frame that shows an extent around the origin as large as possible.

        The header above it has the title, the footer below it the legend.
        """
        wide_m, high_m = (side + 2 * margin_m for side in extent_m)
        scale = min(size_px[0] / wide_m, (size_px[1] - header_px - footer_px) / high_m)
        centre_m = (0.0, (header_px - footer_px) / 2 / scale)
        return cls(size_px=size_px, scale_px_per_m=scale, centre_m=centre_m)

    def to_px(self, x_m: Number, y_m: Number) -> tuple[Number, Number]:
        """Return the position of one or more world points, pixels from the upper left corner."""
        return (
            self.size_px[0] / 2 + (x_m - self.centre_m[0]) * self.scale_px_per_m,
            self.size_px[1] / 2 - (y_m - self.centre_m[1]) * self.scale_px_per_m,
        )

    def all_to_px(self, points_m: Sequence[Point]) -> list[Point]:
        """Return the positions of world points, pixels."""
        return [self.to_px(x, y) for x, y in points_m]
