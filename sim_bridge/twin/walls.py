"""Room of a lab: floor, ceiling, walls around its ground or along its outline, and ground slabs."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.meshes import counter_clockwise, triangulated
from sim_bridge.twin.movers import Point
from sim_bridge.twin.scene import FLOOR_M, Scene
from sim_bridge.twin.solids import Solid

_THICK_M: Final = 0.1
_SLAB_M: Final = 0.2  # thickness of a polygon's contacts


def ground_slabs(scene: Scene) -> list[NDArray[np.float64]]:
    """Return convex bodies, corners (6, 3), that make up a ground with an outline; none without."""
    if not scene.ground_plan.outline_m:
        return []
    outline = counter_clockwise(scene.ground_plan.outline_m)
    slabs = []
    for triangle in triangulated(outline):
        flat = [outline[corner] for corner in triangle]
        ends = itertools.product(flat, (-_SLAB_M, 0.0))
        slabs.append(np.array([(x_m, y_m, z_m) for (x_m, y_m), z_m in ends]))
    return slabs


def room_solids(scene: Scene) -> dict[str, Solid]:
    """Return floor, ceiling and walls of a lab that states walls, by name; none without."""
    if scene.room.walls is None:
        return {}
    wide_m, deep_m, high_m = scene.room_size_m
    half_m = (wide_m / 2 + _THICK_M, deep_m / 2 + _THICK_M, _THICK_M / 2)
    return {
        "floor": Solid(half_m=half_m, centre_m=(0.0, 0.0, FLOOR_M - half_m[2])),
        "ceiling": Solid(half_m=half_m, centre_m=(0.0, 0.0, FLOOR_M + high_m + half_m[2])),
        **wall_solids(scene),
    }


def wall_solids(scene: Scene) -> dict[str, Solid]:
    """Return the walls that the lab states, by their names in contacts; none without."""
    walls = scene.room.walls
    if walls is None:
        return {}
    wide_m, deep_m, _ = scene.room_size_m
    outline = counter_clockwise(scene.ground_plan.corners_m)
    if walls.beside_m > 0.0:
        x_m, y_m = wide_m / 2, deep_m / 2
        outline = [(x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m)]
    count = len(outline)
    return {
        f"wall-{number + 1}": _wall(
            (outline[number - 1], outline[number], outline[(number + 1) % count]),
            outline[(number + 2) % count],
            walls.height_m,
        )
        for number in range(count)
    }


def _wall(corners: tuple[Point, Point, Point], after: Point, height_m: float) -> Solid:
    """Return the wall outside of the side between the last two corners of three.

    It covers the corners of the room at which the room is convex.
    """
    before, first, last = corners
    length_m = math.dist(first, last)
    ux, uy = (last[0] - first[0]) / length_m, (last[1] - first[1]) / length_m
    early_m = _THICK_M if _is_convex(before, first, last) else 0.0
    late_m = _THICK_M if _is_convex(first, last, after) else 0.0
    along_m = (length_m + late_m - early_m) / 2
    return Solid(
        half_m=((length_m + early_m + late_m) / 2, _THICK_M / 2, height_m / 2),
        centre_m=(
            first[0] + along_m * ux + _THICK_M / 2 * uy,
            first[1] + along_m * uy - _THICK_M / 2 * ux,
            height_m / 2,
        ),
        yaw_rad=math.atan2(uy, ux),
    )


def _is_convex(a: Point, b: Point, c: Point) -> bool:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) > 0.0
