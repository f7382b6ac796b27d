"""Scene of the twin: ground, boxes, helipad, movers, light and take-off point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from sim_bridge.twin.movers import KEPT_FREE_M, MoverSpec, mover_names, mover_problem
from sim_bridge.twin.objects import BoxSpec, Helipad, Vector2, Vector3, box_names
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.roles import MARK
from uav_bt.lab.shipped import DEFAULT_LAB, load_lab
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.ground import Footprint, Ground, Standing

CARPET_SIZE_M = (5.0, 4.0)  # size in the paper, along x and y, centred on the origin
ROOM_SIZE_M = (10.0, 10.0, 5.0)  # least size, centred on the origin, the floor at z = 0
FLOOR_M = -0.004  # height of the floor: the carpet is 4 mm thick, its surface is z = 0
_BESIDE_M = 2.5  # least distance from the ground's edge to the walls
_GROUND_SIDES_M = (2.0, 12.0)
MAX_MOVERS = 8
MAX_BOXES = 64  # the class masks distinguish fewer than 256 geoms; a box has two


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """The carpet below the flight.

    Raises:
        ValueRangeError: it is too small or too large.
    """

    size_m: Vector2 = CARPET_SIZE_M  # along x and y, centred on the origin

    def __post_init__(self) -> None:
        low, high = _GROUND_SIDES_M
        if not all(low <= side <= high for side in self.size_m):
            raise ValueRangeError(
                f"ground: size_m must be {low:g} to {high:g} m a side, got {list(self.size_m)}"
            )


@dataclass(frozen=True, kw_only=True)
class Lighting:
    """The light: ambient plus one distant lamp.

    Raises:
        ValueRangeError: ambient is not within 0 to 1, or the light does not shine downwards.
    """

    ambient: float = 0.35  # share of the light without a direction, 0 to 1
    direction: Vector3 = (0.5, 0.3, -1.0)  # direction of travel of the light
    shadows: bool = False  # cast shadows take 10 ms and more per frame without a GPU

    def __post_init__(self) -> None:
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

    position_m: Vector2 | None = None  # None: the helipad, or a random point if `random`
    yaw_deg: float = 0.0  # counter-clockwise from +x; random too if `random`
    random: bool = False  # True: a random free point of the carpet, from the seed of the flight

    def __post_init__(self) -> None:
        if not math.isfinite(self.yaw_deg):
            raise ValueRangeError(f"take_off: yaw_deg must be finite, got {self.yaw_deg}")


@dataclass(frozen=True, kw_only=True)
class LayoutProblem:
    """A mistake in the arrangement of a scene."""

    place: tuple[str | int, ...]  # keys and indices of the faulty item in a scene file
    message: str


def layout_problem(
    helipad: Helipad | None, boxes: Sequence[BoxSpec], ground: GroundSpec
) -> LayoutProblem | None:
    """Return the first mistake in the arrangement of helipad and boxes; None without one."""
    outside = None if helipad is None else _outside(ground, helipad.footprint)
    if outside is not None:
        return LayoutProblem(place=("helipad",), message=f"the helipad {outside}")
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
            wrong = "overlaps the helipad"
        if wrong is not None:
            return LayoutProblem(place=("boxes", index), message=f"{name} {wrong}")
    return None


def _outside(ground: GroundSpec, footprint: Footprint) -> str | None:
    half_x, half_y = (side / 2 for side in ground.size_m)
    for x, y in footprint.corners():
        if abs(x) > half_x + 1e-9 or abs(y) > half_y + 1e-9:
            return (
                f"at [{footprint.x_m:g}, {footprint.y_m:g}] stands outside the carpet: a corner is "
                f"at ({x:.2f}, {y:.2f}), the carpet ends at x = +-{half_x:g}, y = +-{half_y:g}"
            )
    return None


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One arrangement of the lab.

    Raises:
        ValueRangeError: objects overlap or extend beyond the carpet, a mover's path is not free,
            the take-off point is not free, or there is neither a helipad nor a take-off point.
    """

    name: str
    helipad: Helipad | None = None
    boxes: tuple[BoxSpec, ...] = ()
    ground: GroundSpec = field(default_factory=GroundSpec)
    movers: tuple[MoverSpec, ...] = ()
    lighting: Lighting = field(default_factory=Lighting)
    take_off: TakeOffSpec = field(default_factory=TakeOffSpec)
    lab: str = DEFAULT_LAB  # name or path of the lab that the scene belongs to

    @cached_property
    def classes(self) -> LabClasses:
        """The classes of the lab."""
        return load_lab(self.lab).classes

    def class_of(self, item: BoxSpec | MoverSpec) -> int:
        """Return the class of the sides of a box or mover."""
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
        problem = layout_problem(self.helipad, self.boxes, self.ground)
        if problem is not None:
            raise ValueRangeError(f"scene '{self.name}': {problem.message}")
        if self.helipad is None and self.take_off.position_m is None and not self.take_off.random:
            raise ValueRangeError(
                f"scene '{self.name}' has no helipad to take off from: give take_off a place, such "
                "as {from: [-1.5, -1.0]}, or {from: random}"
            )
        if self.take_off.position_m is not None:
            self._check_take_off(*self.take_off.position_m)
        problem = traffic_problem(self, self.movers)
        if problem is not None:
            raise ValueRangeError(f"scene '{self.name}': {problem.message}")

    def _check_take_off(self, x_m: float, y_m: float) -> None:
        if not self.ground_plan.contains(x_m, y_m):
            raise ValueRangeError(
                f"take_off: ({x_m}, {y_m}) is outside the carpet of {self.ground.size_m} m"
            )
        for box, name in zip(self.boxes, box_names(self.boxes), strict=True):
            if box.footprint.distance_m(x_m, y_m) < KEPT_FREE_M:
                raise ValueRangeError(
                    f"take_off: ({x_m}, {y_m}) is within {KEPT_FREE_M} m of {name}"
                )

    @property
    def start_m(self) -> Vector2:
        """The take-off point, unless it is random; then the helipad or the middle."""
        if self.take_off.position_m is not None:
            return self.take_off.position_m
        return (0.0, 0.0) if self.helipad is None else self.helipad.position_m

    @property
    def room_size_m(self) -> Vector3:
        """The size of the room: along x and y, centred on the origin, and its height."""
        x_m, y_m = (
            max(least, side + 2.0 * _BESIDE_M)
            for least, side in zip(ROOM_SIZE_M, self.ground.size_m, strict=False)
        )
        return x_m, y_m, ROOM_SIZE_M[2]

    @property
    def pads(self) -> tuple[Helipad, ...]:
        """The helipad, if there is one."""
        return () if self.helipad is None else (self.helipad,)

    @cached_property
    def ground_plan(self) -> Ground:
        """The ground and the objects on it, the helipad included."""
        return Ground(
            size_m=self.ground.size_m,
            standing=tuple(
                Standing(footprint=footprint, height_m=size_m[2], class_id=class_id)
                for footprint, size_m, class_id in (
                    *((box.footprint, box.size_m, self.class_of(box)) for box in self.boxes),
                    *((pad.footprint, pad.size_m, None) for pad in self.pads),
                )
            ),
        )

    def surface_m(self, x_m: float, y_m: float) -> float:
        """Return the height of the surface at a world point: a box, the pad or the ground."""
        for box in self.boxes:
            if box.footprint.contains(x_m, y_m):
                return box.size_m[2]
        tops_m = [pad.size_m[2] for pad in self.pads if pad.footprint.contains(x_m, y_m)]
        return tops_m[0] if tops_m else 0.0


def obstacle_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the boxes and movers of a scene, in its order."""
    return (*box_names(scene.boxes), *mover_names(scene.movers))


def traffic_problem(scene: Scene, movers: Sequence[MoverSpec]) -> LayoutProblem | None:
    """Return the first mistake in the paths of movers in a scene; None without one."""
    if len(movers) > MAX_MOVERS:
        message = f"at most {MAX_MOVERS} movers, got {len(movers)}"
        return LayoutProblem(place=("movers", MAX_MOVERS), message=message)
    names = (
        *box_names(scene.boxes),
        *("the helipad" for _ in scene.pads),
    )  # in the order of the ground plan
    for index, mover in enumerate(movers):
        wrong = mover_problem(mover, scene.ground_plan, names, scene.take_off.position_m)
        if wrong is not None:
            message = f"mover-{index + 1}: {wrong}"
            return LayoutProblem(place=("movers", index), message=message)
    return None
