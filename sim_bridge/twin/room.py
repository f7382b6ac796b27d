"""Room around the ground: floor, ceiling and walls, and the contacts of a ground with corners."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.scene import Scene
from sim_bridge.twin.shapes import Vector2, block
from uav_bt.lab.obj_file import triangulated
from uav_bt.types.ground import Block, Ground

FLOOR_M: Final = -0.004  # height of the floor: the ground is 4 mm thick, its surface is z = 0
_THICK_M: Final = 0.1
_SLAB_M: Final = 0.2  # thickness of a polygon's contacts


def room_blocks(scene: Scene) -> dict[str, Block]:
    """Return floor, ceiling and walls by their names in contacts."""
    (wide_m, deep_m, high_m), half_m = scene.room_size_m, _THICK_M / 2
    top_m = FLOOR_M + high_m
    walls = wall_blocks(scene)
    beside_m = _THICK_M if walls else 0.0
    flat_m = (wide_m / 2 + beside_m, deep_m / 2 + beside_m)
    slabs: dict[str, Block] = {
        "floor": block(flat_m, FLOOR_M - _THICK_M, FLOOR_M),
        "ceiling": block(flat_m, top_m, top_m + _THICK_M),
    }
    if walls:
        return slabs | walls
    x_m, y_m = wide_m / 2 + half_m, deep_m / 2 + half_m
    return slabs | {
        "wall-east": block((half_m, deep_m / 2), FLOOR_M, top_m, (x_m, 0.0)),
        "wall-west": block((half_m, deep_m / 2), FLOOR_M, top_m, (-x_m, 0.0)),
        "wall-north": block((wide_m / 2, half_m), FLOOR_M, top_m, (0.0, y_m)),
        "wall-south": block((wide_m / 2, half_m), FLOOR_M, top_m, (0.0, -y_m)),
    }


def wall_blocks(scene: Scene) -> dict[str, Block]:
    """Return the walls that the lab states, by their names in contacts; none without."""
    walls = scene.room.walls
    if walls is None:
        return {}
    outline: Sequence[Vector2] = scene.ground.corners_m
    if walls.beside_m > 0.0:
        outline = Ground(size_m=scene.room_size_m[:2]).corners_m
    count = len(outline)
    return {
        f"wall-{number + 1}": _wall(
            [outline[(number + step) % count] for step in (-1, 0, 1, 2)], walls.height_m
        )
        for number in range(count)
    }


def _wall(corners: Sequence[Vector2], height_m: float) -> Block:
    """Return the wall outside of the side between the middle two corners of four.

    It covers the corners of the room at which the room is convex.
    """
    before, first, last, after = corners
    length_m = math.dist(first, last)
    ux, uy = (last[0] - first[0]) / length_m, (last[1] - first[1]) / length_m
    early_m = _THICK_M if _is_convex(before, first, last) else 0.0
    late_m = _THICK_M if _is_convex(first, last, after) else 0.0
    along_m = (length_m + late_m - early_m) / 2
    centre_m = (
        first[0] + along_m * ux + _THICK_M / 2 * uy,
        first[1] + along_m * uy - _THICK_M / 2 * ux,
    )
    wall = block(((length_m + early_m + late_m) / 2, _THICK_M / 2), 0.0, height_m, centre_m)
    return replace(wall, footprint=replace(wall.footprint, yaw_rad=math.atan2(uy, ux)))


def _is_convex(a: Vector2, b: Vector2, c: Vector2) -> bool:
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) > 0.0


def ground_slabs(ground: Ground) -> list[NDArray[np.float64]]:
    """Return convex bodies, corners (6, 3), that make up a ground with an outline."""
    slabs = []
    for triangle in triangulated(ground.outline_m):
        flat = [ground.outline_m[corner] for corner in triangle]
        ends = itertools.product(flat, (-_SLAB_M, 0.0))
        slabs.append(np.array([(x_m, y_m, z_m) for (x_m, y_m), z_m in ends]))
    return slabs
