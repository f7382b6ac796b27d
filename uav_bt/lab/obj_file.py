"""Reader of OBJ files: closed meshes of triangles and polygons, without materials."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError
from uav_bt.files import read_bounded, reading

MAX_FACES: Final = 4000
MAX_BYTES: Final = 1_000_000
MAX_PIECES: Final = 64
_FEWEST: Final = 4  # triangles of a closed mesh
_THINNEST_M: Final = 2e-4  # standard deviation of the corners of a piece across it
_IGNORED: Final = ("", "vn", "vt", "o", "g", "s", "usemtl", "mtllib", "l", "p")

Face = tuple[int, int, int]
Point = tuple[float, float]


def read_obj(path: Path, size_m: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return a mesh, z up, fitted to the length, width and height of its bounding box.

    (N, 3, 3) corners of its triangles, metres, counter-clockwise from outside; the origin is the
    middle of the base of the bounding box.
    """
    triangles = _read(path)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if not (high - low > 0.0).all():
        raise FileError(path, "the mesh is flat: it needs an extent along x, y and z")
    triangles = (triangles - (low + high) / 2) * (np.array(size_m) / (high - low))
    triangles[..., 2] += size_m[2] / 2
    parts = pieces(triangles)
    if len(parts) > MAX_PIECES:
        raise FileError(path, f"has {len(parts)} separate pieces: at most {MAX_PIECES}")
    return np.ascontiguousarray(np.concatenate([_outwards(path, part) for part in parts]))


def _outwards(path: Path, piece: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a piece with its faces counter-clockwise from outside."""
    corners = piece.reshape(-1, 3) - piece.mean(axis=(0, 1))
    thinnest_m = float(np.linalg.svd(corners, compute_uv=False).min()) / math.sqrt(len(corners))
    a, b, c = (corners.reshape(piece.shape)[:, each] for each in range(3))
    volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())
    if thinnest_m < _THINNEST_M or volume == 0.0:
        raise FileError(path, "a piece of the mesh is flat: it encloses no volume")
    return piece if volume > 0.0 else piece[:, ::-1]


def pieces(triangles: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the connected pieces, (M, 3, 3) each, of triangles (N, 3, 3) that share corners."""
    corners, which = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = which.reshape(-1, 3)
    label = np.arange(len(corners))
    while True:  # each corner takes the least label of its faces, until nothing changes
        least = label[faces].min(axis=1)
        lower = label.copy()
        np.minimum.at(lower, faces.ravel(), np.repeat(least, 3))
        if np.array_equal(lower, label):
            break
        label = lower
    of_face = label[faces[:, 0]]
    return [triangles[of_face == each] for each in dict.fromkeys(of_face.tolist())]


def _read(path: Path) -> NDArray[np.float64]:
    """Return the triangles of a closed mesh, (N, 3, 3), in the units of the file."""
    with reading(path):
        text = read_bounded(path, MAX_BYTES, cure="simplify the mesh").decode("utf-8-sig")
    vertices: list[list[float]] = []
    faces: list[Face] = []
    for number, line in enumerate(text.splitlines(), start=1):
        key, *words = line.split("#")[0].split() or ("",)
        try:
            if key == "v":
                vertices.append(_vertex(words))
            elif key == "f":
                faces += _triangles(words, vertices)
            good = key in ("v", "f", *_IGNORED)
        except ValueError:
            good = False
        if not good:
            message = f"expected 'v X Y Z' or 'f 1 2 3 ...' with known vertices, got '{line:.60}'"
            raise FileError(path, message, number)
        if len(faces) > MAX_FACES:
            raise FileError(path, f"has more than {MAX_FACES} triangles: simplify the mesh", number)
    if len(faces) < _FEWEST:
        raise FileError(path, f"is no closed mesh: it has {len(faces)} triangles")
    _check_closed(path, faces)
    return np.asarray(np.array(vertices)[np.array(faces)])


def _vertex(words: list[str]) -> list[float]:
    point = [float(word) for word in words[:3]]
    if len(point) < 3 or not all(map(math.isfinite, point)):
        raise ValueError
    return point


def _triangles(words: list[str], vertices: list[list[float]]) -> list[Face]:
    """Return a face as triangles; negative numbers count from the last vertex."""
    count = len(vertices)
    numbers = [int(word.partition("/")[0]) for word in words]
    corners = [number - 1 if number > 0 else count + number for number in numbers]
    known = all(0 <= corner < count for corner in corners)
    if not known or len(corners) < 3 or len(set(corners)) < len(corners):
        raise ValueError
    points = np.array([vertices[corner] for corner in corners])
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())  # the face is cut as it looks along this axis
    across = (
        ((axis + 1) % 3, (axis + 2) % 3) if normal[axis] > 0.0 else ((axis + 2) % 3, (axis + 1) % 3)
    )
    cut = triangulated([(float(point[across[0]]), float(point[across[1]])) for point in points])
    return [(corners[a], corners[b], corners[c]) for a, b, c in cut]


def _check_closed(path: Path, faces: list[Face]) -> None:
    """Refuse a mesh in which an edge does not belong to two triangles, once in each direction."""
    edges = Counter(edge for a, b, c in faces for edge in ((a, b), (b, c), (c, a)))
    for a, b in edges:
        if edges[a, b] != 1 or edges[b, a] != 1:
            edge = f"the edge between the vertices {a + 1} and {b + 1}"
            fault = f"{edge} does not lie between exactly two faces of one orientation"
            raise FileError(path, f"the mesh is not closed: {fault}")


def triangulated(outline: Sequence[Point]) -> list[Face]:
    """Return the triangles of a polygon without crossing sides, counter-clockwise, by corners.

    They are a fan around the first corner if all of it is seen from there; otherwise ears are cut.
    """
    left, triangles = list(range(len(outline))), list[Face]()
    fan = [(0, one, other) for one, other in itertools.pairwise(left[1:])]
    if all(_turn(*(outline[each] for each in face)) > 0.0 for face in fan):
        return fan
    while len(left) > 3:
        for place, corner in enumerate(left):
            before, after = left[place - 1], left[(place + 1) % len(left)]
            ear = [outline[each] for each in (before, corner, after)]
            rest = (outline[each] for each in left if each not in (before, corner, after))
            if _turn(*ear) > 0.0 and not any(_covers(ear, point) for point in rest):
                triangles.append((before, corner, after))
                left.pop(place)
                break
        else:  # corners in one line are left
            left.pop(min(range(len(left)), key=lambda at: _flatness(outline, left, at)))
    return [*triangles, (left[0], left[1], left[2])]


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _covers(ear: Sequence[Point], point: Point) -> bool:
    a, b, c = ear
    return min(_turn(a, b, point), _turn(b, c, point), _turn(c, a, point)) >= 0.0


def _flatness(outline: Sequence[Point], left: Sequence[int], at: int) -> float:
    before, corner, after = (outline[left[each % len(left)]] for each in (at - 1, at, at + 1))
    return abs(_turn(before, corner, after)) / max(math.dist(before, after), 1e-9)
