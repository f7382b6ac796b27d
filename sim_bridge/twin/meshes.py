"""Meshes of polygons, triangles and composed parts, with texture coordinates in tiles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.movers import Point
from sim_bridge.twin.solids import Mesh

_MOST_TRIANGLES: Final = 20_000  # of a finer mesh


def merged(meshes: Sequence[Mesh], centres_m: Sequence[tuple[float, float, float]]) -> Mesh:
    """Return one mesh of several, each moved to its centre."""
    counts = np.cumsum([0, *(len(vertices) for vertices, _, _ in meshes)])
    return (
        np.vstack(
            [each[0] + np.array(at, np.float32) for each, at in zip(meshes, centres_m, strict=True)]
        ),
        np.vstack([each[1] + first for each, first in zip(meshes, counts, strict=False)]).astype(
            np.int32
        ),
        np.vstack([each[2] for each in meshes]),
    )


def finer(mesh: Mesh, longest_m: float) -> Mesh:
    """Return a mesh whose edges are at most that long: lamps light the corners of triangles."""
    vertices, faces, coordinates = mesh
    corners, places = vertices[faces], coordinates[faces]  # (M, 3, 3) and (M, 3, 2)
    while len(corners) * 4 <= _MOST_TRIANGLES:
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        if edges.max() <= longest_m:
            break
        corners, places = _split(corners), _split(places)
    count = 3 * len(corners)
    return (
        np.ascontiguousarray(corners.reshape(count, 3), np.float32),
        np.arange(count, dtype=np.int32).reshape(-1, 3),
        np.ascontiguousarray(places.reshape(count, 2), np.float32),
    )


def _split(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return each triangle, (M, 3, k), as four."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def triangle_mesh(triangles: NDArray[np.float64], tile_m: Point) -> Mesh:
    """Make a mesh of triangles, (N, 3, 3); the texture is projected along the steepest axis."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    axis = np.abs(normals).argmax(axis=1)
    across = np.array(((1, 2), (0, 2), (0, 1)))[axis]  # axes of u and v
    flat = np.take_along_axis(triangles, across[:, None, :].repeat(3, axis=1), axis=2)
    return (
        triangles.reshape(-1, 3).astype(np.float32),
        np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3),
        (0.5 + flat.reshape(-1, 2) / tile_m).astype(np.float32),
    )


def prism_mesh(outline_m: Sequence[Point], low_m: float, high_m: float, tile_m: Point) -> Mesh:
    """Make an upright prism over a polygon; the texture lies on its top, middle at the origin."""
    outline = counter_clockwise(outline_m)
    flat = np.array(outline)[np.array(triangulated(outline))]  # (M, 3, 2)

    def level(z_m: float) -> NDArray[np.float64]:
        return np.concatenate([flat, np.full((*flat.shape[:2], 1), z_m)], axis=2)

    sides = []
    for (ax, ay), (bx, by) in zip(outline, (*outline[1:], outline[0]), strict=True):
        a, b = (ax, ay, low_m), (bx, by, low_m)
        c, d = (bx, by, high_m), (ax, ay, high_m)
        sides += [(a, b, c), (a, c, d)]
    triangles = np.concatenate([level(high_m), level(low_m)[:, ::-1], np.array(sides)])
    vertices = triangles.reshape(-1, 3)
    return (
        vertices.astype(np.float32),
        np.arange(len(vertices), dtype=np.int32).reshape(-1, 3),
        (0.5 + vertices[:, :2] / tile_m).astype(np.float32),
    )


def counter_clockwise(outline_m: Sequence[Point]) -> list[Point]:
    """Return a polygon's corners counter-clockwise."""
    around = zip(outline_m, (*outline_m[1:], outline_m[0]), strict=True)
    area = sum(ax * by - ay * bx for (ax, ay), (bx, by) in around)
    return list(outline_m) if area > 0.0 else list(reversed(outline_m))


def triangulated(outline_m: Sequence[Point]) -> list[tuple[int, int, int]]:
    """Return the triangles of a polygon without crossing sides, by cutting ears.

    Args:
        outline_m: corners, counter-clockwise.
    """
    left, triangles = list(range(len(outline_m))), []
    while len(left) > 3:
        for place, corner in enumerate(left):
            before, after = left[place - 1], left[(place + 1) % len(left)]
            ear = [outline_m[each] for each in (before, corner, after)]
            rest = (outline_m[each] for each in left if each not in (before, corner, after))
            if _turn(*ear) > 0.0 and not any(_covers(ear, point) for point in rest):
                triangles.append((before, corner, after))
                left.pop(place)
                break
        else:  # corners in one line are left
            left.pop(min(range(len(left)), key=lambda at: _flatness(outline_m, left, at)))
    return [*triangles, (left[0], left[1], left[2])]


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _covers(ear: Sequence[Point], point: Point) -> bool:
    a, b, c = ear
    return min(_turn(a, b, point), _turn(b, c, point), _turn(c, a, point)) >= 0.0


def _flatness(outline_m: Sequence[Point], left: Sequence[int], at: int) -> float:
    before, corner, after = (outline_m[left[each % len(left)]] for each in (at - 1, at, at + 1))
    return abs(_turn(before, corner, after)) / max(math.dist(before, after), 1e-9)
