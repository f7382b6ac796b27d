"""Scene of the twin: ground, boxes, landing mark, movers, light and take-off point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from sim_bridge.twin.lab_of_scene import SceneLab, lab_of_scene
from sim_bridge.twin.layout import (
    GroundSpec,
    LayoutError,
    LayoutProblem,
    ground_of,
    layout_problem,
)
from sim_bridge.twin.movers import KEPT_FREE_M, MoverSpec, mover_names, mover_problem
from sim_bridge.twin.objects import BoxSpec, Helipad, Vector2, Vector3, box_names
from sim_bridge.twin.placed import (
    ObjectSpec,
    PlacedObject,
    Shape,
    object_names,
    of_its_kind,
    shape_named,
)
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import MARK, LabClasses
from uav_bt.lab.room import MAX_LAMPS, Lamp, RoomSection
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.ground import Ground, Standing

ROOM_SIZE_M = (10.0, 10.0, 5.0)  # least size, centred on the origin, the floor at z = 0
FLOOR_M = -0.004  # height of the floor: the ground is 4 mm thick, its surface is z = 0
_BESIDE_M = 2.5  # least distance from the ground's edge to the walls
MAX_MOVERS = 8


@dataclass(frozen=True, kw_only=True)
class Lighting:
    """The light: ambient plus one distant lamp, or lamps in the room.

    Raises:
        ValueRangeError: ambient is not within 0 to 1, the light does not shine downwards, or there
            are too many lamps.
    """

    ambient: float = 0.35  # share of the light without a direction, 0 to 1
    direction: Vector3 = (0.5, 0.3, -1.0)  # direction of travel of the light
    shadows: bool = False  # cast shadows take 10 ms and more per frame without a GPU
    lamps: tuple[Lamp, ...] = ()  # in place of the distant lamp

    def __post_init__(self) -> None:
        if len(self.lamps) > MAX_LAMPS:
            raise ValueRangeError(f"lighting: at most {MAX_LAMPS} lamps, got {len(self.lamps)}")
        if not 0.0 <= self.ambient <= 1.0:
            raise ValueRangeError(f"lighting: ambient must lie within 0 and 1, got {self.ambient}")
        if not all(math.isfinite(v) for v in self.direction) or self.direction[2] >= 0.0:
            raise ValueRangeError(
                "lighting: direction must be finite and point downwards (negative z), "
                f"got {list(self.direction)}"
            )


@dataclass(frozen=True, kw_only=True)
class TakeOffSpec:
    """The pose of the drone before take-off.

    Raises:
        ValueRangeError: the yaw is not finite.
    """

    position_m: Vector2 | None = None  # None: the mark, or a random point if `random`
    yaw_deg: float = 0.0  # counter-clockwise from +x; random too if `random`
    random: bool = False  # True: a random free point of the ground, from the seed of the flight

    def __post_init__(self) -> None:
        if not math.isfinite(self.yaw_deg):
            raise ValueRangeError(f"take_off: yaw_deg must be finite, got {self.yaw_deg}")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One arrangement of the lab.

    Raises:
        ValueRangeError: objects overlap or extend beyond the ground, a mover's path is not free,
            the take-off point is not free, there is neither a mark nor a take-off point, or the
            lab has no such kind, no class of that pattern, or another ground.
    """

    name: str
    helipad: Helipad | None = None
    boxes: tuple[BoxSpec, ...] = ()
    ground: GroundSpec = field(default_factory=GroundSpec)
    movers: tuple[MoverSpec, ...] = ()
    lighting: Lighting = field(default_factory=Lighting)
    take_off: TakeOffSpec = field(default_factory=TakeOffSpec)
    lab: str = DEFAULT_LAB  # name or folder of the lab that the scene belongs to
    objects: tuple[ObjectSpec, ...] = ()

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
    def classes(self) -> LabClasses:
        """The classes of the lab."""
        return self.place.lab.classes

    @cached_property
    def placed(self) -> tuple[PlacedObject, ...]:
        """The objects with their names and shapes.

        Raises:
            ValueRangeError: the lab has no such kind.
        """
        return tuple(
            PlacedObject(name=name, spec=spec, shape=self.shape_of(spec.kind))
            for name, spec in zip(object_names(self.objects), self.objects, strict=True)
        )

    def shape_of(self, kind: str) -> Shape:
        """Return the shape of a kind of the lab."""
        return shape_named(kind, self.place.shapes, self.lab)

    def class_of(self, item: BoxSpec | MoverSpec) -> int:
        """Return the class of the sides of a box or mover."""
        if isinstance(item, MoverSpec) and item.kind is not None:
            return self.shape_of(item.kind).class_id
        return self.classes.standing[item.pattern - 1]

    @property
    def mark_class(self) -> int:
        """The class of the sides of the landing box."""
        sides = self.classes.mark_sides
        return self.classes.of_role(MARK)[0] if sides is None else sides

    @property
    def mark_top(self) -> int:
        """The class of the middle of the landing box's top."""
        return int(self.classes.top_of[self.mark_class]) or self.mark_class

    @property
    def mark(self) -> LandingMark | None:
        """The landing mark; None without one."""
        return None if self.helipad is None else self.helipad.mark

    @property
    def mark_pose(self) -> Pose2D | None:
        """The pose of the landing mark in the drawing, yaw counter-clockwise; None without one."""
        if self.helipad is None:
            return None
        x_m, y_m = self.helipad.position_m
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(self.helipad.yaw_deg))

    @property
    def take_off_pose(self) -> Pose2D | None:
        """The take-off pose in the drawing, yaw counter-clockwise; None where it is random."""
        if self.take_off.random:
            return None
        x_m, y_m = self.start_m
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(self.take_off.yaw_deg))

    def __post_init__(self) -> None:
        if not isinstance(self.ground, GroundSpec):
            raise ValueRangeError(
                f"scene '{self.name}' has no ground: expected a GroundSpec, got {self.ground!r}; "
                "leave `ground` out for 4 x 4 m"
            )
        problem = lab_problem(self)
        if problem is None:
            placed = self.placed if self.objects else ()
            problem = layout_problem(self.helipad, self.boxes, self.ground, placed)
        if problem is not None:
            raise LayoutError(self.name, problem)
        if self.helipad is None and self.take_off.position_m is None and not self.take_off.random:
            raise ValueRangeError(
                f"scene '{self.name}' has no landing mark to take off from: give take_off a place, "
                "such as {from: [-1.5, -1.0]}, or {from: random}"
            )
        if self.take_off.position_m is not None:
            self._check_take_off(*self.take_off.position_m)
        problem = traffic_problem(self, self.movers)
        if problem is not None:
            raise LayoutError(self.name, problem)

    def _check_take_off(self, x_m: float, y_m: float) -> None:
        if not self.ground_plan.contains(x_m, y_m):
            raise ValueRangeError(
                f"take_off: ({x_m}, {y_m}) is outside the ground of {self.ground.size_m} m"
            )
        names = (*box_names(self.boxes), *(item.name for item in self.placed))
        items: tuple[BoxSpec | PlacedObject, ...] = (*self.boxes, *self.placed)
        for item, name in zip(items, names, strict=True):
            if item.footprint.distance_m(x_m, y_m) < KEPT_FREE_M:
                raise ValueRangeError(
                    f"take_off: ({x_m}, {y_m}) is within {KEPT_FREE_M} m of {name}"
                )

    @property
    def start_m(self) -> Vector2:
        """The take-off point, unless it is random; then the mark or the middle."""
        if self.take_off.position_m is not None:
            return self.take_off.position_m
        return (0.0, 0.0) if self.helipad is None else self.helipad.position_m

    @property
    def room_size_m(self) -> Vector3:
        """The size of the room: along x and y, centred on the origin, and its height."""
        walls = self.room.walls if self.lab != DEFAULT_LAB else None
        if walls is not None:
            wide_m, deep_m = (side + 2.0 * walls.beside_m for side in self.ground.size_m)
            return wide_m, deep_m, walls.height_m
        x_m, y_m = (
            max(least, side + 2.0 * _BESIDE_M)
            for least, side in zip(ROOM_SIZE_M, self.ground.size_m, strict=False)
        )
        return x_m, y_m, ROOM_SIZE_M[2]

    @property
    def pads(self) -> tuple[Helipad, ...]:
        """The landing mark, if there is one."""
        return () if self.helipad is None else (self.helipad,)

    @cached_property
    def ground_plan(self) -> Ground:
        """The ground and the objects on it, the landing mark included."""
        plan = self.ground.plan
        return replace(
            plan,
            standing=(
                *(
                    Standing(
                        footprint=box.footprint,
                        height_m=box.size_m[2],
                        class_id=self.class_of(box),
                    )
                    for box in self.boxes
                ),
                *(item.standing for item in self.placed),
                *(Standing(footprint=pad.footprint, height_m=pad.size_m[2]) for pad in self.pads),
            ),
        )

    def surface_m(self, x_m: float, y_m: float, below_m: float = math.inf) -> float:
        """Return the height of the surface at a world point: an object, the pad or the ground.

        Args:
            x_m: world x.
            y_m: world y.
            below_m: height of what looks down: a table's top above it does not count.
        """
        for box in self.boxes:
            if box.footprint.contains(x_m, y_m):
                return box.size_m[2]
        tops_m = [pad.size_m[2] for pad in self.pads if pad.footprint.contains(x_m, y_m)]
        tops_m += [
            block.top_m
            for item in self.placed
            if item.footprint.contains(x_m, y_m)
            for block in item.standing.blocks
            if block.base_m < below_m and block.footprint.contains(x_m, y_m)
        ]
        return max(tops_m, default=0.0)


def lab_problem(scene: Scene) -> LayoutProblem | None:
    """Return the first thing of a scene that its lab does not have; None without one."""
    if scene.lab == DEFAULT_LAB and not scene.objects:
        return _kind_problem(scene) if any(mover.kind for mover in scene.movers) else None
    section = scene.room.ground
    if section is not None and scene.ground != ground_of(section):
        message = f"the lab '{scene.lab}' states its ground: use that of layout.ground_of"
        return LayoutProblem(place=("ground",), message=message)
    most = len(scene.classes.standing)
    patterns = [("boxes", number, box.pattern) for number, box in enumerate(scene.boxes)]
    patterns += [
        ("movers", number, mover.pattern)
        for number, mover in enumerate(scene.movers)
        if mover.kind is None
    ]
    for key, number, pattern in patterns:
        if pattern > most:
            message = (
                f"the lab '{scene.lab}' has no class for pattern {pattern}, only {most} classes: "
                "use the kinds of its 'room'"
            )
            return LayoutProblem(place=(key, number), message=message)
    return _kind_problem(scene)


def _kind_problem(scene: Scene) -> LayoutProblem | None:
    place: tuple[str | int, ...] = ()
    try:
        for index, spec in enumerate(scene.objects):
            place = ("objects", index)
            scene.shape_of(spec.kind)
        for index, mover in enumerate(scene.movers):
            place = ("movers", index)
            whole = mover.kind is None or of_its_kind(mover, scene.place.shapes, scene.lab)
            if whole not in (True, mover):
                message = f"a mover of the kind '{mover.kind}' has its size and shape"
                return LayoutProblem(place=place, message=message)
    except ValueRangeError as error:
        return LayoutProblem(place=place, message=str(error))
    return None


def obstacle_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the boxes, objects and movers of a scene, in its order."""
    objects = (item.name for item in scene.placed)
    return (*box_names(scene.boxes), *objects, *mover_names(scene.movers))


def traffic_problem(scene: Scene, movers: Sequence[MoverSpec]) -> LayoutProblem | None:
    """Return the first mistake in the paths of movers in a scene; None without one."""
    if len(movers) > MAX_MOVERS:
        message = f"at most {MAX_MOVERS} movers, got {len(movers)}"
        return LayoutProblem(place=("movers", MAX_MOVERS), message=message)
    names = (
        *box_names(scene.boxes),
        *(item.name for item in scene.placed),
        *("the landing mark" for _ in scene.pads),
    )  # in the order of the ground plan
    for index, mover in enumerate(movers):
        wrong = mover_problem(mover, scene.ground_plan, names, scene.take_off.position_m)
        if wrong is not None:
            message = f"mover-{index + 1}: {wrong}"
            return LayoutProblem(place=("movers", index), message=message)
    return None
