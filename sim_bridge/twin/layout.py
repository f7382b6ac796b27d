"""The arrangement of a scene on its ground: nothing overlaps or leaves the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from sim_bridge.twin.objects import BoxSpec, Helipad, Vector2, box_names
from sim_bridge.twin.placed import MAX_OBJECTS, PlacedObject
from uav_bt.errors import ValueRangeError
from uav_bt.lab.room import GROUND_SIDES_M, GroundSection
from uav_bt.types.ground import Footprint, Ground, Standing

CARPET_SIZE_M = (5.0, 4.0)  # size in the paper, along x and y, centred on the origin
MAX_BOXES = 64
_ROUNDING_M = 1e-9


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """The ground below the flight: a rectangle, in the paper's lab the carpet.

    Raises:
        ValueRangeError: it is too small or too large.
    """

    size_m: Vector2 = CARPET_SIZE_M  # along x and y, centred on the origin
    sides_m: ClassVar[Vector2] = (2.0, 12.0)

    def __post_init__(self) -> None:
        low, high = self.sides_m
        if not all(low <= side <= high for side in self.size_m):
            raise ValueRangeError(
                f"ground: size_m must be {low:g} to {high:g} m a side, got {list(self.size_m)}"
            )

    @cached_property
    def plan(self) -> Ground:
        """The ground without objects."""
        return Ground(size_m=self.size_m)


@dataclass(frozen=True, kw_only=True)
class LabGround(GroundSpec):
    """The ground that a lab states, a rectangle or a polygon."""

    outline_m: tuple[Vector2, ...] = ()
    sides_m: ClassVar[Vector2] = GROUND_SIDES_M

    @cached_property
    def plan(self) -> Ground:
        """The ground without objects."""
        return Ground(size_m=self.size_m, outline_m=self.outline_m)


def ground_of(section: GroundSection | None) -> GroundSpec:
    """Return the ground of a lab; the paper's carpet if the lab states none."""
    if section is None:
        return GroundSpec()
    return LabGround(size_m=section.extent_m, outline_m=section.outline_m or ())


@dataclass(frozen=True, kw_only=True)
class LayoutProblem:
    """A mistake in the arrangement of a scene."""

    place: tuple[str | int, ...]  # keys and indices of the faulty item in a scene file
    message: str


class LayoutError(ValueRangeError):
    """A scene is arranged impossibly.

    Attributes:
        problem: The first mistake.
    """

    def __init__(self, scene: str, problem: LayoutProblem) -> None:
        super().__init__(f"scene '{scene}': {problem.message}")
        self.problem = problem


def layout_problem(
    helipad: Helipad | None,
    boxes: Sequence[BoxSpec],
    ground: GroundSpec,
    objects: Sequence[PlacedObject] = (),
) -> LayoutProblem | None:
    """Return the first mistake in the arrangement of mark, boxes and objects; None without."""
    outside = None if helipad is None else _outside(ground, helipad.footprint)
    if outside is not None:
        return LayoutProblem(place=("helipad",), message=f"the landing mark {outside}")
    if len(boxes) > MAX_BOXES:
        message = f"at most {MAX_BOXES} boxes, got {len(boxes)}"
        return LayoutProblem(place=("boxes", MAX_BOXES), message=message)
    names = box_names(boxes)
    for index, (box, name) in enumerate(zip(boxes, names, strict=True)):
        wrong = _outside(ground, box.footprint)
        for other, other_name in zip(boxes[:index], names, strict=False):
            if wrong is None and box.footprint.overlaps(other.footprint):
                wrong = f"overlaps {other_name}"
        if wrong is None and helipad is not None and box.footprint.overlaps(helipad.footprint):
            wrong = "overlaps the landing mark"
        if wrong is not None:
            return LayoutProblem(place=("boxes", index), message=f"{name} {wrong}")
    return _object_problem(helipad, boxes, ground, objects)


def _object_problem(
    helipad: Helipad | None,
    boxes: Sequence[BoxSpec],
    ground: GroundSpec,
    objects: Sequence[PlacedObject],
) -> LayoutProblem | None:
    if len(objects) > MAX_OBJECTS:
        message = f"at most {MAX_OBJECTS} objects, got {len(objects)}"
        return LayoutProblem(place=("objects", MAX_OBJECTS), message=message)
    others = [
        (name, Standing(footprint=box.footprint, height_m=box.size_m[2]))
        for name, box in zip(box_names(boxes), boxes, strict=True)
    ]
    if helipad is not None:
        pad = Standing(footprint=helipad.footprint, height_m=helipad.drawn_size_m[2])
        others.append(("the landing mark", pad))
    for index, item in enumerate(objects):
        wrong = _outside(ground, item.footprint)
        if wrong is None:
            wrong = next(
                (f"overlaps {name}" for name, other in others if item.overlaps(other)), None
            )
        if wrong is not None:
            return LayoutProblem(place=("objects", index), message=f"{item.name} {wrong}")
        others.append((item.name, item.standing))
    return None


def _outside(ground: GroundSpec, footprint: Footprint) -> str | None:
    stands = f"at [{footprint.x_m:g}, {footprint.y_m:g}] stands outside the ground"
    if ground.plan.outline_m:
        return None if _lies_in(ground.plan, footprint) else stands
    half_x, half_y = (side / 2 for side in ground.size_m)
    for x, y in _extremes(footprint):
        if abs(x) > half_x + _ROUNDING_M or abs(y) > half_y + _ROUNDING_M:
            return (
                f"{stands}: a corner is at ({x:.2f}, {y:.2f}), the ground ends at "
                f"x = +-{half_x:g}, y = +-{half_y:g}"
            )
    return None


def _extremes(footprint: Footprint) -> list[Vector2]:
    """Return the corners of a box; of a circle those of the square along the world's axes."""
    if not footprint.round:
        return footprint.corners()
    x_m, y_m, radius_m = footprint.x_m, footprint.y_m, footprint.half_x_m
    return [(x_m + sx * radius_m, y_m + sy * radius_m) for sx in (-1, 1) for sy in (-1, 1)]


def _lies_in(plan: Ground, footprint: Footprint) -> bool:
    """Return whether an outline lies on a polygon: no side of the polygon passes through it."""
    if footprint.round:
        return plan.margin_m(footprint.x_m, footprint.y_m) >= footprint.half_x_m - _ROUNDING_M
    corners_in = all(plan.margin_m(x, y) >= -_ROUNDING_M for x, y in footprint.corners())
    return corners_in and not any(_pierces(edge, footprint) for edge in plan.area.edges[0])


def _pierces(edge: tuple[float, float, float, float], box: Footprint) -> bool:
    """Return whether a side passes through the inside of a box (slab method)."""
    ax, ay, ex, ey = edge
    enters, leaves = 0.0, 1.0
    first, last = box.to_body(ax, ay), box.to_body(ax + ex, ay + ey)
    for begin, end, half in zip(first, last, (box.half_x_m, box.half_y_m), strict=True):
        half_m = half - _ROUNDING_M
        if abs(end - begin) < 1e-12:
            if abs(begin) >= half_m:
                return False
            continue
        one, other = (-half_m - begin) / (end - begin), (half_m - begin) / (end - begin)
        enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
    return enters < leaves
