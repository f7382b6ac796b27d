"""Checks of the arrangement of a scene: nothing overlaps, leaves the ground or stands in a path."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import MAT_M
from sim_bridge.twin.shapes import Vector2
from uav_bt.errors import ValueRangeError
from uav_bt.types.ground import Footprint, Ground, Standing

MAX_MOVERS: Final = 8
MARK_NAME: Final = "the landing mark"
KEPT_FREE_M: Final = 0.25  # least distance from the take-off point to objects and movers
_ROUNDING_M: Final = 1e-9


class LayoutError(ValueRangeError):
    """A scene is arranged impossibly; `place` is that of the faulty item in a scene file."""

    others: Sequence[LayoutError] = ()  # further faults of the scene

    def __init__(self, message: str, *place: str | int) -> None:
        super().__init__(message)
        self.place = place


def refuse(faults: Iterable[LayoutError]) -> None:
    """Raise the first fault, which has the others."""
    found = list(faults)
    if found:
        found[0].others = found[1:]
        raise found[0]


def object_faults(
    ground: Ground, standing: Mapping[str, Standing], names: Sequence[str], hanging: Collection[str]
) -> Iterator[LayoutError]:
    """Yield objects, of all with these names, that overlap one before them or leave the ground.

    What hangs at a wall may be beside it.
    """
    items = list(standing.items())
    for index, (name, item) in enumerate(items):
        wrong = None if name in hanging else outside(ground, item.footprint)
        for other_name, other in items[:index]:
            if wrong is None and overlaps(item, other):
                wrong = f"overlaps {other_name}"
        if wrong is not None:
            place = ("helipad",) if name == MARK_NAME else ("objects", names.index(name))
            yield LayoutError(f"{name} {wrong}", *place)


def take_off_faults(
    ground: Ground, standing: Mapping[str, Standing], take_off_m: Vector2
) -> Iterator[LayoutError]:
    """Yield that a take-off point is off the ground or near an obstacle."""
    x_m, y_m = take_off_m
    if not ground.contains(x_m, y_m):
        size = f"of {ground.size_m[0]:g} x {ground.size_m[1]:g} m"
        yield LayoutError(f"({x_m}, {y_m}) is outside the ground {size}", "take_off")
    for name, item in standing.items():
        if name != MARK_NAME and item.footprint.distance_m(x_m, y_m) < KEPT_FREE_M:
            yield LayoutError(f"({x_m}, {y_m}) is within {KEPT_FREE_M} m of {name}", "take_off")


def mover_faults(
    movers: Sequence[MoverSpec],
    ground: Ground,
    standing: Mapping[str, Standing],
    take_off_m: Vector2 | None,
) -> Iterator[LayoutError]:
    """Yield movers whose path leaves the ground or is not free."""
    for index, mover in enumerate(movers):
        off = [corner for corner in mover.path_m if not ground.contains(*corner)]
        wrong = f"leaves the ground at {place_text(off[0])}" if off else None
        for name, item in standing.items():
            leg = leg_through(mover, item.footprint)
            if wrong is None and leg is not None:
                wrong = f"leads through {name} from {place_text(leg[0])} to {place_text(leg[1])}"
        if wrong is None and take_off_m and mover.distance_m(*take_off_m) < KEPT_FREE_M:
            wrong = f"comes within {KEPT_FREE_M} m of the take-off place {place_text(take_off_m)}"
        if wrong is not None:
            yield LayoutError(f"mover-{index + 1}: its path {wrong}", "movers", index)


def leg_through(mover: MoverSpec, footprint: Footprint) -> tuple[Vector2, Vector2] | None:
    """Return the first leg of a mover's path that leads through an outline; None without one."""
    corners = np.array(footprint.corners(), dtype=np.float32)
    for leg, swept in zip(mover.legs(), mover.swept, strict=True):
        if cv2.intersectConvexConvex(swept, corners)[0] > 1e-6:
            return leg
    return None


def place_text(place_m: Vector2) -> str:
    """Return a place as scene files have it."""
    return "[{:g}, {:g}]".format(*(round(value, 2) + 0.0 for value in place_m))


def overlaps(one: Standing, other: Standing) -> bool:
    """Return whether a part of an object is inside a part of another one."""
    return one.footprint.overlaps(other.footprint) and any(
        part.base_m < max(another.top_m, MAT_M)
        and another.base_m < max(part.top_m, MAT_M)
        and part.footprint.overlaps(another.footprint)
        for part in one.blocks
        for another in other.blocks
    )


def outside(ground: Ground, footprint: Footprint) -> str | None:
    """Return where an outline leaves the ground; None if it does not."""
    stands = f"at [{footprint.x_m:g}, {footprint.y_m:g}] stands outside the ground"
    if ground.outline_m:
        return None if _lies_in(ground, footprint) else stands
    half_x, half_y = (side / 2 for side in ground.size_m)
    around = replace(footprint, yaw_rad=0.0) if footprint.round else footprint
    for x, y in around.corners():
        if abs(x) > half_x + _ROUNDING_M or abs(y) > half_y + _ROUNDING_M:
            return (
                f"{stands}: a corner is at ({x:.2f}, {y:.2f}), the ground ends at "
                f"x = +-{half_x:g}, y = +-{half_y:g}"
            )
    return None


def _lies_in(ground: Ground, footprint: Footprint) -> bool:
    """Return whether an outline lies on a polygon: no side of the polygon passes through it."""
    if footprint.round:
        return ground.margin_m(footprint.x_m, footprint.y_m) >= footprint.half_x_m - _ROUNDING_M
    corners_in = all(ground.margin_m(x, y) >= -_ROUNDING_M for x, y in footprint.corners())
    return corners_in and not any(_pierces(edge, footprint) for edge in ground.area.edges[0])


def _pierces(edge: Sequence[float], box: Footprint) -> bool:
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
