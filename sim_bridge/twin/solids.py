"""Meshes of upright boxes and cylinders, with texture coordinates in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.objects import Vector3

_ROUND_FACES = 32  # faces of a cylinder: an error of half a percent of its radius
_PAPER_M = 0.001  # thickness of a roof, a sheet at the top of its box

Mesh = tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]
"""Vertices (N, 3) in metres, triangles (M, 3), texture coordinates (N, 2) in tiles."""


@dataclass(frozen=True, kw_only=True)
class Solid:
    """An upright box or cylinder: half sizes, centre, yaw counter-clockwise."""

    half_m: Vector3
    centre_m: Vector3
    yaw_rad: float = 0.0
    round: bool = False

    def mesh(self, tile_m: tuple[float, float]) -> Mesh:
        """Return the mesh, textured in tiles of this width and height."""
        return (cylinder_mesh if self.round else box_mesh)(self.half_m, tile_m)


def stacked(
    position_m: tuple[float, float], size_m: Vector3, yaw_rad: float, *, is_round: bool = False
) -> tuple[Solid, Solid, Solid]:
    """Return a standing solid, the part below its roof, and the roof."""
    half_x, half_y, half_z = (size / 2 for size in size_m)
    sheet = _PAPER_M / 2

    def part(half_height_m: float, middle_m: float) -> Solid:
        half_m, centre_m = (half_x, half_y, half_height_m), (*position_m, middle_m)
        return Solid(half_m=half_m, centre_m=centre_m, yaw_rad=yaw_rad, round=is_round)

    body = part(half_z - sheet, half_z - sheet)
    return part(half_z, half_z), body, part(sheet, size_m[2] - sheet)


def yaw_quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) of a yaw angle."""
    return math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)


def box_mesh(half_m: Vector3, tile_m: tuple[float, float]) -> Mesh:
    """Make a box with four vertices per face, so that each face has separate texture coordinates.

    Texture coordinates count from the middle of each face; textures are upright on the sides.

    Args:
        half_m: half sizes along x, y and upwards.
        tile_m: width and height of one repetition of the texture.
    """
    hx, hy, hz = half_m
    # Per face: normal, direction of u, direction of v, half extents along u and v.
    faces = (
        ((1, 0, 0), (0, 1, 0), (0, 0, 1), hy, hz),
        ((-1, 0, 0), (0, -1, 0), (0, 0, 1), hy, hz),
        ((0, 1, 0), (-1, 0, 0), (0, 0, 1), hx, hz),
        ((0, -1, 0), (1, 0, 0), (0, 0, 1), hx, hz),
        ((0, 0, 1), (1, 0, 0), (0, 1, 0), hx, hy),
        ((0, 0, -1), (1, 0, 0), (0, -1, 0), hx, hy),
    )
    half = np.array(half_m)
    vertices, coordinates, triangles = [], [], []
    for index, (normal, u, v, half_u, half_v) in enumerate(faces):
        for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            vertices.append((np.array(normal) + su * np.array(u) + sv * np.array(v)) * half)
            coordinates.append((0.5 + su * half_u / tile_m[0], 0.5 + sv * half_v / tile_m[1]))
        first = 4 * index
        triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return (
        np.array(vertices, np.float32),
        np.array(triangles, np.int32),
        np.array(coordinates, np.float32),
    )


def cylinder_mesh(half_m: Vector3, tile_m: tuple[float, float]) -> Mesh:
    """Make an upright cylinder; the texture wraps around its side and lies flat on its ends.

    Args:
        half_m: radius, radius, half height.
        tile_m: width and height of one repetition of the texture.
    """
    radius, _, half_z = half_m
    turns = np.linspace(0.0, 2.0 * np.pi, _ROUND_FACES + 1)  # two columns of vertices at the seam
    x, y, ones = radius * np.cos(turns), radius * np.sin(turns), np.ones_like(turns)
    around, up = turns * radius / tile_m[0], half_z / tile_m[1]
    side = [(np.stack([x, y, end * half_z * ones], axis=1), end) for end in (-1.0, 1.0)]
    vertices = [ring for ring, _ in side]
    coordinates = [np.stack([around, (0.5 + end * up) * ones], axis=1) for _, end in side]
    low = np.arange(_ROUND_FACES)
    high = low + len(turns)
    triangles = [
        np.stack([low, low + 1, high + 1], axis=1),
        np.stack([low, high + 1, high], axis=1),
    ]
    for ring, end in side:
        first = sum(map(len, vertices))
        vertices += [ring, np.array([[0.0, 0.0, end * half_z]])]
        flat = np.vstack([ring[:, :2], (0.0, 0.0)])
        coordinates.append(0.5 + flat / tile_m)
        edge, middle = first + low, np.full(_ROUND_FACES, first + len(ring))
        fan = [edge, edge + 1, middle] if end > 0.0 else [edge + 1, edge, middle]
        triangles.append(np.stack(fan, axis=1))
    return (
        np.vstack(vertices).astype(np.float32),
        np.vstack(triangles).astype(np.int32),
        np.vstack(coordinates).astype(np.float32),
    )
