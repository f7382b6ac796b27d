"""Objects of a lab's kinds that a scene places, any number of one kind."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.movers import MoverSpec, Point
from sim_bridge.twin.shapes import Part, parts_of
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.lab import Lab
from uav_bt.lab.room import ObjectKind
from uav_bt.types.ground import Block, Footprint, Standing

MAX_OBJECTS = 200


@dataclass(frozen=True, kw_only=True)
class ObjectSpec:
    """An object that stands on the ground.

    Raises:
        ValueRangeError: a number is not finite.
    """

    kind: str  # of the lab
    position_m: Point  # centre on the ground, world x and y
    yaw_deg: float = 0.0  # counter-clockwise from +x

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.position_m, self.yaw_deg))):
            raise ValueRangeError(f"{self.kind}: position and yaw must be finite numbers")


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """Shapes that the twin builds of a kind.

    Attributes:
        name: Name of the kind.
        kind: The kind in the lab file.
        class_id: Class of its surfaces.
        top_class: Class of its upper face.
        parts: Boxes and cylinders that it consists of.
        mesh: (N, 3, 3) triangles of a mesh; None: the parts are the shape.
    """

    name: str
    kind: ObjectKind
    class_id: int
    top_class: int
    parts: tuple[Part, ...]
    mesh: NDArray[np.float64] | None = None

    @property
    def round(self) -> bool:
        """Whether it is a cylinder."""
        return self.kind.shape == "cylinder"

    def standing(self, position_m: Point, yaw_deg: float) -> Standing:
        """Return the shape at a place on the ground."""
        yaw_rad = math.radians(yaw_deg)
        whole = Footprint(
            x_m=position_m[0],
            y_m=position_m[1],
            half_x_m=self.kind.size_m[0] / 2,
            half_y_m=self.kind.size_m[1] / 2,
            yaw_rad=yaw_rad,
            round=self.round,
        )
        blocks = tuple(_block(whole, part) for part in self.parts)
        return Standing(
            footprint=whole,
            height_m=self.kind.size_m[2],
            class_id=self.class_id,
            parts=() if len(blocks) == 1 and self.mesh is None else blocks,
        )


def _block(whole: Footprint, part: Part) -> Block:
    x_m, y_m = whole.to_world(*part.centre_m)
    return Block(
        footprint=Footprint(
            x_m=x_m,
            y_m=y_m,
            half_x_m=part.half_m[0],
            half_y_m=part.half_m[1],
            yaw_rad=whole.yaw_rad,
            round=part.round,
        ),
        base_m=part.base_m,
        top_m=part.top_m,
    )


def shapes_of(lab: Lab) -> dict[str, Shape]:
    """Return the shapes of a lab's kinds by name."""
    if lab.room is None:
        return {}
    shapes = {}
    for name, kind in lab.room.section.objects.items():
        class_id, mesh = lab.classes.id_of(kind.class_name), lab.room.meshes.get(name)
        shapes[name] = Shape(
            name=name,
            kind=kind,
            class_id=class_id,
            top_class=int(lab.classes.top_of[class_id]) or class_id,
            parts=parts_of(kind, mesh),
            mesh=mesh,
        )
    return shapes


def shape_named(name: str, shapes: Mapping[str, Shape], lab: str) -> Shape:
    """Return a shape by name.

    Raises:
        ValueRangeError: the lab has no kinds, or none of that name.
    """
    if not shapes:
        raise ValueRangeError(
            f"the lab '{lab}' has no kinds of objects: add 'room' with 'objects' to its lab file"
        )
    if name not in shapes:
        raise ValueRangeError(str(UnknownNameError("kind of object", name, shapes)))
    return shapes[name]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedObject:
    """An object of a scene: its name in contacts, its shape and its place."""

    name: str
    spec: ObjectSpec
    shape: Shape

    @cached_property
    def standing(self) -> Standing:
        """The object on the ground."""
        return self.shape.standing(self.spec.position_m, self.spec.yaw_deg)

    @property
    def footprint(self) -> Footprint:
        """The outline of the whole from above."""
        return self.standing.footprint

    def overlaps(self, other: Standing) -> bool:
        """Return whether a part of it is inside a part of another object."""
        return self.standing.footprint.overlaps(other.footprint) and any(
            one.base_m < another.top_m
            and another.base_m < one.top_m
            and one.footprint.overlaps(another.footprint)
            for one in self.standing.blocks
            for another in other.blocks
        )


def object_names(specs: Sequence[ObjectSpec]) -> tuple[str, ...]:
    """Return the names of objects in contacts and messages: `drum-1`, `drum-2`."""
    counts: Counter[str] = Counter()
    names = []
    for spec in specs:
        counts[spec.kind] += 1
        names.append(f"{spec.kind}-{counts[spec.kind]}")
    return tuple(names)


def of_its_kind(mover: MoverSpec, shapes: Mapping[str, Shape], lab: str) -> MoverSpec:
    """Return a mover with the size and outline of its kind; without a kind as it is.

    Raises:
        ValueRangeError: the lab has no such kind, or the mover states another size.
    """
    if mover.kind is None:
        return mover
    shape = shape_named(mover.kind, shapes, lab)
    size_m = shape.kind.size_m
    if mover.size_m not in (MoverSpec.size_m, size_m):
        raise ValueRangeError(
            f"the size of a '{mover.kind}' is that of its kind, {list(size_m)}: remove size_m"
        )
    return replace(mover, size_m=size_m, shape="cylinder" if shape.round else "box")
