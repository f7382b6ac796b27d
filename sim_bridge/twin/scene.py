"""Scene of the twin: ground, objects, landing mark, movers, light and take-off point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated

from pydantic import Field

from sim_bridge.twin.layout import (
    MARK_NAME,
    LayoutError,
    mover_faults,
    object_faults,
    refuse,
    take_off_faults,
)
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import Helipad, ObjectSpec, PlacedObject, object_names
from sim_bridge.twin.room import at_wall, wall_blocks
from sim_bridge.twin.shapes import PRINTED, SceneLab, Shape, Vector2, Vector3, lab_of_scene
from uav_bt.errors import InputError
from uav_bt.lab.classes import MARK, LabClasses
from uav_bt.lab.room import MAX_LAMPS, ON_WALL, ROUND, Lamp, RoomSection
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.types import LandingMark, MoverState, Pose2D
from uav_bt.types.ground import Block, Ground, Standing

CARPET_SIZE_M = (5.0, 4.0)  # size in the paper, along x and y, centred on the origin
ROOM_SIZE_M = (10.0, 10.0, 5.0)  # least size of a room without walls in its lab file
_BESIDE_M = 2.5  # least distance there from the ground's edge to the walls


@dataclass(frozen=True, kw_only=True)
class Lighting:
    """The light: ambient plus one distant lamp, or lamps in the room."""

    ambient: Annotated[float, Field(ge=0.0, le=1.0)] = 0.35  # share of light without a direction
    # Direction of travel of the light, downwards.
    direction: tuple[float, float, Annotated[float, Field(lt=0.0)]] = (0.5, 0.3, -1.0)
    shadows: bool = False  # cast shadows take 10 ms and more per frame without a GPU
    # In place of the distant lamp.
    lamps: Annotated[tuple[Lamp, ...], Field(max_length=MAX_LAMPS)] = ()


@dataclass(frozen=True, kw_only=True)
class TakeOffSpec:
    """The pose of the drone before take-off."""

    position_m: Vector2 | None = None  # None: the mark, or a random point if `random`
    yaw_deg: float = 0.0  # counter-clockwise from +x; random too if `random`
    random: bool = False  # True: a random free point of the ground, from the seed of the flight


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One arrangement of a lab.

    Raises:
        LayoutError: objects overlap or extend beyond the ground, a mover's path is not free, the
            take-off point is not free, there is neither a mark nor a take-off point, or the lab
            has no such kind.
    """

    name: str
    helipad: Helipad | None = None
    objects: tuple[ObjectSpec, ...] = ()
    ground_size_m: Vector2 | None = None  # None: the ground of the lab, or the paper's carpet
    movers: tuple[MoverSpec, ...] = ()
    lighting: Lighting = field(default_factory=Lighting)
    take_off: TakeOffSpec = field(default_factory=TakeOffSpec)
    lab: str = DEFAULT_LAB  # name or folder of the lab that the scene belongs to

    def __post_init__(self) -> None:
        place, known = self.take_off.position_m, list[MoverSpec]()
        faults = [each for each in self._tried if isinstance(each, LayoutError)]
        for index, mover in enumerate(self.movers):
            try:
                known.append(self.of_its_kind(mover))
            except InputError as error:
                known.append(mover)
                faults.append(LayoutError(str(error), "movers", index))
        object.__setattr__(self, "movers", tuple(known))
        hanging = {item.name for item in self.placed if item.shape.kind.shape in ON_WALL}
        faults += object_faults(self.ground, self.standing, object_names(self.objects), hanging)
        if self.helipad is None and place is None and not self.take_off.random:
            message = (
                f"scene '{self.name}' has no landing mark to take off from: give take_off a place, "
                "such as {from: [-1.5, -1.0]}, or {from: random}"
            )
            faults.append(LayoutError(message, "take_off"))
        if place is not None:
            faults += take_off_faults(self.ground, self.standing, place)
        faults += mover_faults(self.movers, self.ground, self.standing, place)
        refuse(faults)

    def check_movers(self, movers: Sequence[MoverSpec]) -> None:
        """Refuse movers whose paths are not free in this scene."""
        refuse(mover_faults(movers, self.ground, self.standing, self.take_off.position_m))

    @cached_property
    def place(self) -> SceneLab:
        """The lab, with the shapes of its kinds."""
        return lab_of_scene(self.lab)

    @property
    def room(self) -> RoomSection:
        """The section `room` of the lab file; an empty one if it has none."""
        room = self.place.lab.room
        return RoomSection() if room is None else room.section

    @cached_property
    def ground(self) -> Ground:
        """The ground without objects: that of the lab, or a rectangle."""
        section = self.room.ground
        if section is None or self.ground_size_m is not None:
            return Ground(size_m=self.ground_size_m or CARPET_SIZE_M)
        return Ground(
            size_m=section.extent_m, outline_m=_counter_clockwise(section.outline_m or ())
        )

    @cached_property
    def wall_corners_m(self) -> tuple[Vector2, ...]:
        """The corners of the walls that the lab states, counter-clockwise; none without."""
        walls = self.room.walls
        if walls is None:
            return ()
        beside = walls.beside_m > 0.0
        return (Ground(size_m=self.room_size_m[:2]) if beside else self.ground).corners_m

    @cached_property
    def walls(self) -> dict[str, Block]:
        """The walls that the lab states, by their names in contacts."""
        return wall_blocks(self.wall_corners_m, self.room_size_m[2])

    @property
    def room_size_m(self) -> Vector3:
        """The size of the room: along x and y, centred on the origin, and its height."""
        (x_m, y_m), walls = self.ground.size_m, self.room.walls
        if walls is not None:
            return x_m + 2.0 * walls.beside_m, y_m + 2.0 * walls.beside_m, walls.height_m
        wide_m, deep_m, high_m = ROOM_SIZE_M
        return max(wide_m, x_m + 2.0 * _BESIDE_M), max(deep_m, y_m + 2.0 * _BESIDE_M), high_m

    @cached_property
    def classes(self) -> LabClasses:
        """The classes of the lab."""
        return self.place.lab.classes

    @property
    def mark_class(self) -> int:
        """The class of the sides of the landing box."""
        sides = self.classes.mark_sides
        return self.classes.of_role(MARK)[0] if sides is None else sides

    @property
    def mark_top(self) -> int:
        """The class of the middle of the landing box's top."""
        return int(self.classes.top_of[self.mark_class]) or self.mark_class

    def shape_of(self, item: ObjectSpec | MoverSpec) -> Shape:
        """Return the shape of an object or mover; refuse a kind that the lab does not have."""
        if isinstance(item, MoverSpec) and item.kind is None:
            shape = self.place.shape(f"{PRINTED}{item.pattern}")
            return shape.of_size(item.size_m, item.shape)
        shape = self.place.shape(item.kind or "")
        return shape if item.size_m is None else shape.of_size(item.size_m)

    def of_its_kind(self, mover: MoverSpec) -> MoverSpec:
        """Return a mover with the size and outline of its kind; refuse another size."""
        if mover.kind is None:
            self.shape_of(mover)
            return mover
        kind = self.place.shape(mover.kind).kind
        if mover.size_m not in (MoverSpec.size_m, kind.size_m):
            expected = f"that of its kind, {list(kind.size_m)}"
            raise InputError(f"the size of a '{mover.kind}' is {expected}: remove size_m")
        if kind.shape in ON_WALL:
            raise InputError(f"a {kind.shape} does not move: choose another kind")
        is_round = kind.shape in ROUND
        return replace(mover, size_m=kind.size_m, shape="cylinder" if is_round else "box")

    @cached_property
    def placed(self) -> tuple[PlacedObject, ...]:
        """The objects with their names, shapes and poses."""
        return tuple(each for each in self._tried if isinstance(each, PlacedObject))

    @cached_property
    def _tried(self) -> list[PlacedObject | LayoutError]:
        """The objects, and the reasons why the others cannot be placed."""
        tried: list[PlacedObject | LayoutError] = []
        names = object_names(self.objects)
        for index, (name, spec) in enumerate(zip(names, self.objects, strict=True)):
            try:
                shape, pose = self.shape_of(spec), None
                if spec.wall is not None or shape.kind.shape in ON_WALL:
                    pose = at_wall(spec, shape.kind.size_m, self.wall_corners_m)
                tried.append(PlacedObject(name=name, spec=spec, shape=shape, at_wall=pose))
            except InputError as error:
                tried.append(LayoutError(str(error), "objects", index))
        return tried

    @cached_property
    def standing(self) -> dict[str, Standing]:
        """The objects on the ground by name, and the landing mark."""
        objects = {item.name: item.standing for item in self.placed}
        return objects if self.helipad is None else {**objects, MARK_NAME: self.helipad.standing}

    @cached_property
    def ground_plan(self) -> Ground:
        """The ground and the objects on it, the landing mark included."""
        return replace(self.ground, standing=tuple(self.standing.values()))

    @cached_property
    def _mover_outlines(self) -> list[Standing]:
        return [self.shape_of(mover).outline for mover in self.movers]

    def surface_m(
        self, x_m: float, y_m: float, below_m: float = math.inf, movers: Sequence[MoverState] = ()
    ) -> float:
        """Return the height of the surface at a world point: an object, the pad or the ground.

        What lies above `below_m` does not count, such as the top of a table.
        """
        there = [(item, x_m, y_m) for item in self.ground_plan.standing]
        for item, state in zip(self._mover_outlines, movers, strict=False):
            there.append((item, *state.pose.to_body(x_m, y_m)))
        tops_m = [
            block.top_m
            for item, x, y in there
            if item.footprint.contains(x, y)
            for block in item.blocks
            if block.base_m < below_m and block.footprint.contains(x, y)
        ]
        return max(tops_m, default=0.0)

    @property
    def pads(self) -> tuple[Helipad, ...]:
        """The landing mark, if there is one."""
        return () if self.helipad is None else (self.helipad,)

    @property
    def mark(self) -> LandingMark | None:
        """The landing mark; None without one."""
        return None if self.helipad is None else self.helipad.mark

    @property
    def mark_pose(self) -> Pose2D | None:
        """The pose of the landing mark in the drawing, yaw counter-clockwise; None without one."""
        return None if self.helipad is None else self.helipad.pose

    @property
    def start_m(self) -> Vector2:
        """The take-off point, unless it is random; then the mark or the middle."""
        if self.take_off.position_m is not None:
            return self.take_off.position_m
        return (0.0, 0.0) if self.helipad is None else self.helipad.position_m

    @property
    def take_off_pose(self) -> Pose2D | None:
        """The take-off pose in the drawing, yaw counter-clockwise; None where it is random."""
        if self.take_off.random:
            return None
        x_m, y_m = self.start_m
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(self.take_off.yaw_deg))


def _counter_clockwise(outline_m: tuple[Vector2, ...]) -> tuple[Vector2, ...]:
    around = zip(outline_m, outline_m[1:] + outline_m[:1], strict=True)
    area_m2 = sum(ax * by - ay * bx for (ax, ay), (bx, by) in around)
    return outline_m if area_m2 >= 0.0 else outline_m[::-1]
