"""Room around the ground: floor, ceiling, walls and places at them; a ground with corners."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.furniture import block
from sim_bridge.twin.layout import place_text
from sim_bridge.twin.objects import ObjectSpec
from sim_bridge.twin.shapes import Vector2, Vector3
from uav_bt.errors import ValueRangeError
from uav_bt.lab.obj_file import triangulated
from uav_bt.types import Pose2D
from uav_bt.types.ground import Block, Footprint, Ground
from uav_bt.types.pose import clamp, wrap_angle

FLOOR_M: Final = -0.004  # height of the floor: the ground is 4 mm thick, its surface is z = 0
_THICK_M: Final = 0.1
_SLAB_M: Final = 0.2  # thickness of a polygon's contacts
_ROUNDING_M: Final = 1e-9
_ON_WALL_M: Final = 0.1  # largest distance of a place that lies on a wall
_SIDE_RAD: Final = math.pi / 4 + 1e-9  # between a wall and its side of the room; chosen
_SIDES: Final = {"north": math.pi / 2, "east": 0.0, "south": -math.pi / 2, "west": math.pi}


def room_blocks(size_m: Vector3, walls: dict[str, Block]) -> dict[str, Block]:
    """Return floor, ceiling and walls by their names in contacts; without walls four of them."""
    (wide_m, deep_m, high_m), half_m = size_m, _THICK_M / 2
    top_m = FLOOR_M + high_m
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


def wall_blocks(corners_m: Sequence[Vector2], height_m: float) -> dict[str, Block]:
    """Return the walls along an outline, counter-clockwise, by their names in contacts."""
    count = len(corners_m)
    return {
        f"wall-{number + 1}": _wall(
            [corners_m[(number + step) % count] for step in (-1, 0, 1, 2)], height_m
        )
        for number in range(count)
    }


def at_wall(spec: ObjectSpec, size_m: Vector3, corners_m: Sequence[Vector2]) -> Pose2D:
    """Return the pose of an object whose back is at a wall of an outline."""
    faces = [_face(*ends) for ends in zip(corners_m, (*corners_m[1:], *corners_m[:1]), strict=True)]
    if not faces:
        raise ValueRangeError("the room has no walls: add 'walls' to the room of the lab file")
    if spec.yaw_deg:
        raise ValueRangeError("at a wall an object faces the room: remove 'yaw_deg'")
    if spec.position_m is not None:
        face = _face_at(spec.position_m, faces)
        along_m, _ = face.to_body(*spec.position_m)
    else:
        face = _face_named(spec.wall or 0, faces)
        leads = abs(wrap_angle(face.yaw_rad - math.pi / 4)) < math.pi / 2  # to the right or up
        along_m = spec.along_m if leads else -spec.along_m
    free_m = face.half_x_m - size_m[0] / 2
    if abs(along_m) > free_m + _ROUNDING_M:
        where = f"at most {max(free_m, 0.0):.2f} m from the middle of the wall"
        cure = f"make it smaller, or place its middle {where}, got {abs(along_m):.2f}"
        raise ValueRangeError(f"reaches beyond its wall of {2 * face.half_x_m:.2f} m: {cure}")
    x_m, y_m = face.to_world(along_m, size_m[1] / 2)
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=wrap_angle(face.yaw_rad + math.pi))


def _face(first: Vector2, last: Vector2) -> Footprint:
    """Return the inner face of a wall, with the room on its left."""
    return Footprint(
        x_m=(first[0] + last[0]) / 2,
        y_m=(first[1] + last[1]) / 2,
        half_x_m=math.dist(first, last) / 2,
        half_y_m=0.0,
        yaw_rad=math.atan2(last[1] - first[1], last[0] - first[0]),
    )


def _face_named(wall: str | int, faces: Sequence[Footprint]) -> Footprint:
    """Return the face of a wall by its number, or by the side of the room."""
    fits = [number == wall for number in range(1, len(faces) + 1)]
    if isinstance(wall, str):
        aim_rad = _SIDES[wall] + math.pi / 2
        fits = [abs(wrap_angle(face.yaw_rad - aim_rad)) < _SIDE_RAD for face in faces]
    if sum(fits) == 1:
        return faces[fits.index(True)]
    middles = ", ".join(
        f"{number} (its middle is {place_text((face.x_m, face.y_m))})"
        for number, (face, fitting) in enumerate(zip(faces, fits, strict=True), start=1)
        if fitting or not any(fits)
    )
    raise ValueRangeError(f"wall: '{wall}' names {sum(fits)} walls; choose one: {middles}")


def _face_at(place_m: Vector2, faces: Sequence[Footprint]) -> Footprint:
    """Return the face of the wall on which a place lies."""
    face = min(faces, key=lambda each: each.distance_m(*place_m))
    if face.distance_m(*place_m) > _ON_WALL_M:
        along_m = clamp(face.to_body(*place_m)[0], face.half_x_m)
        on_wall = place_text(face.to_world(along_m, 0.0))
        cure = f"the nearest place on one is {on_wall}; or give 'wall' and 'along_m'"
        raise ValueRangeError(f"{place_text(place_m)} lies on no wall: {cure}")
    return face


def _wall(corners: Sequence[Vector2], height_m: float) -> Block:
    """Return the wall outside of the side between the middle two corners of four.

    It covers the corners of the room at which the room is convex.
    """
    before, first, last, after = corners
    early_m = _THICK_M if _is_convex(before, first, last) else 0.0
    late_m = _THICK_M if _is_convex(first, last, after) else 0.0
    face = _face(first, last)
    centre_m = ((late_m - early_m) / 2, -_THICK_M / 2)
    wall = block((face.half_x_m + (early_m + late_m) / 2, _THICK_M / 2), 0.0, height_m, centre_m)
    return wall.at(face)


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
