"""Meshes of boxes, cylinders, polygons and triangles, with texture coordinates in tiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.shapes import Vector2
from uav_bt.lab.obj_file import triangulated
from uav_bt.types.ground import Block

_ROUND_FACES: Final = 32  # faces of a cylinder: an error of half a percent of its radius
_MOST_TRIANGLES: Final = 20_000  # of a finer mesh

Mesh = tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]
"""Vertices (N, 3) in metres, triangles (M, 3), texture coordinates (N, 2) in tiles."""


def block_mesh(blocks: Sequence[Block], tile_m: Vector2) -> Mesh:
    """Make one mesh of boxes and cylinders that are not turned, in tiles of a width and height."""
    vertices: list[NDArray[np.float32]] = []
    triangles: list[NDArray[np.int64]] = []
    coordinates: list[NDArray[np.float64]] = []
    first = 0
    for block in blocks:
        outline = block.footprint
        points, faces, places = (_cylinder if outline.round else _box)(block, tile_m)
        middle_m = (outline.x_m, outline.y_m, (block.base_m + block.top_m) / 2)
        vertices.append(points.astype(np.float32) + np.array(middle_m, np.float32))
        triangles.append(faces + first)
        coordinates.append(places)
        first += len(points)
    return (
        np.vstack(vertices),
        np.vstack(triangles).astype(np.int32),
        np.vstack(coordinates).astype(np.float32),
    )


_Made = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]

# Faces of a box: normals, directions of u, directions of v. Textures are upright on the sides.
_FACES: Final = np.array(
    [
        [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)],
        [(0, 1, 0), (0, -1, 0), (-1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)],
        [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 1, 0), (0, -1, 0)],
    ]
)
_CORNERS: Final = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])  # of a face, along u and v
_HALVES: Final = np.array([(0, 1, 2), (0, 2, 3)])  # triangles of a face


def _box(block: Block, tile_m: Vector2) -> _Made:
    """Return four vertices per face: texture coordinates count from the middle of each face."""
    outline = block.footprint
    half = np.array((outline.half_x_m, outline.half_y_m, (block.top_m - block.base_m) / 2))
    normals, u, v = _FACES[:, :, None]
    vertices = (normals + _CORNERS[:, :1] * u + _CORNERS[:, 1:] * v) * half  # (6, 4, 3)
    sides = np.concatenate([np.abs(u) @ half, np.abs(v) @ half], axis=1)
    coordinates = 0.5 + _CORNERS * (sides / tile_m)[:, None]
    triangles = 4 * np.arange(6)[:, None, None] + _HALVES
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3), coordinates.reshape(-1, 2)


def _cylinder(block: Block, tile_m: Vector2) -> _Made:
    """Return an upright cylinder; the texture wraps around its side and lies flat on its ends."""
    radius, half_z = block.footprint.half_x_m, (block.top_m - block.base_m) / 2
    turns = np.linspace(0.0, 2.0 * np.pi, _ROUND_FACES + 1)  # two columns of vertices at the seam
    ring, count = radius * np.column_stack([np.cos(turns), np.sin(turns)]), len(turns)
    low, high = (np.pad(ring, ((0, 0), (0, 1)), constant_values=z) for z in (-half_z, half_z))
    ends = np.array([[(0.0, 0.0, -half_z)], [(0.0, 0.0, half_z)]])
    around, up = (turns * radius / tile_m[0])[:, None], half_z / tile_m[1]
    sides = [np.pad(around, ((0, 0), (0, 1)), constant_values=0.5 + z) for z in (-up, up)]
    flat = 0.5 + ring / tile_m
    middle = np.array([(0.5, 0.5)])
    edge = np.arange(_ROUND_FACES)
    first, last = 2 * count + edge, 3 * count + 1 + edge  # of the two ends
    triangles = [
        (edge, edge + 1, count + edge + 1),
        (edge, count + edge + 1, count + edge),
        (first + 1, first, np.full_like(edge, 3 * count)),
        (last, last + 1, np.full_like(edge, 4 * count + 1)),
    ]
    faces = np.hstack([np.stack(corners) for corners in triangles]).T
    vertices = np.vstack([low, high, low, ends[0], high, ends[1]])
    return vertices, faces, np.vstack([*sides, flat, middle, flat, middle])


def triangle_mesh(triangles: NDArray[np.float64], tile_m: Vector2) -> Mesh:
    """Make a mesh of triangles, (N, 3, 3); the texture is projected along the steepest axis."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    axis = np.abs(normals).argmax(axis=1)
    across = np.array(((1, 2), (0, 2), (0, 1)))[axis]  # axes of u and v
    flat = np.take_along_axis(triangles, across[:, None, :].repeat(3, axis=1), axis=2)
    return _unshared(triangles, 0.5 + flat / tile_m)


def prism_mesh(outline_m: Sequence[Vector2], low_m: float, high_m: float, tile_m: Vector2) -> Mesh:
    """Make an upright prism over a polygon, counter-clockwise, with the texture on its top."""
    outline = np.array(outline_m)
    flat = outline[np.array(triangulated(outline_m))]  # (M, 3, 2)

    def level(z_m: float, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([points, np.full((*points.shape[:-1], 1), z_m)], axis=-1)

    low, high = level(low_m, outline), level(high_m, outline)
    after, above = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    sides = np.concatenate([np.stack([low, after, above], 1), np.stack([low, above, high], 1)])
    triangles = np.concatenate([level(high_m, flat), level(low_m, flat)[:, ::-1], sides])
    return _unshared(triangles, 0.5 + triangles[..., :2] / tile_m)


def finer(mesh: Mesh, longest_m: float) -> Mesh:
    """Return a mesh whose edges are at most that long: lamps light the corners of triangles."""
    vertices, faces, coordinates = mesh
    corners, places = vertices[faces], coordinates[faces]  # (M, 3, 3) and (M, 3, 2)
    while len(corners) * 4 <= _MOST_TRIANGLES:
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        if edges.max() <= longest_m:
            break
        corners, places = _split(corners), _split(places)
    return _unshared(corners, places)


def _split(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return each triangle, (M, 3, k), as four."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _unshared(corners: NDArray[np.floating], places: NDArray[np.floating]) -> Mesh:
    """Return the mesh of triangles, (M, 3, 3), that share no vertices."""
    count = 3 * len(corners)
    return (
        np.ascontiguousarray(corners.reshape(count, 3), np.float32),
        np.arange(count, dtype=np.int32).reshape(-1, 3),
        np.ascontiguousarray(places.reshape(count, 2), np.float32),
    )
