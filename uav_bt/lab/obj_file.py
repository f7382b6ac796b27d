"""Reader of OBJ files: closed meshes of triangles and polygons, without materials."""

from __future__ import annotations

import itertools
import math
from collections import Counter
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


def read_obj(path: Path, size_m: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return a mesh, z up, fitted to the length, width and height of its bounding box.

    (N, 3, 3) corners of its triangles, metres, counter-clockwise from outside; the origin is the
    middle of the base of the bounding box.
    """
    vertices, faces = _read(path)
    _check_closed(path, faces)
    points = np.array(vertices)
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high - low > 0.0).all():
        raise FileError(path, "the mesh is flat: it needs an extent along x, y and z")
    points = (points - (low + high) / 2) * (np.array(size_m) / (high - low))
    points[:, 2] += size_m[2] / 2
    parts = pieces(points[np.array(faces)])
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


def _read(path: Path) -> tuple[list[list[float]], list[Face]]:
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
                faces += _triangles(words, len(vertices))
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
    return vertices, faces


def _vertex(words: list[str]) -> list[float]:
    point = [float(word) for word in words[:3]]
    if len(point) < 3 or not all(map(math.isfinite, point)):
        raise ValueError
    return point


def _triangles(words: list[str], count: int) -> list[Face]:
    """Return a face as triangles; `count` vertices are known, of which negative numbers count."""
    numbers = [int(word.partition("/")[0]) for word in words]
    corners = [number - 1 if number > 0 else count + number for number in numbers]
    known = all(0 <= corner < count for corner in corners)
    if not known or len(corners) < 3 or len(set(corners)) < len(corners):
        raise ValueError
    return [(corners[0], one, other) for one, other in itertools.pairwise(corners[1:])]


def _check_closed(path: Path, faces: list[Face]) -> None:
    """Refuse a mesh in which an edge does not belong to two triangles, once in each direction."""
    edges = Counter(edge for a, b, c in faces for edge in ((a, b), (b, c), (c, a)))
    for a, b in edges:
        if edges[a, b] != 1 or edges[b, a] != 1:
            edge = f"the edge between the vertices {a + 1} and {b + 1}"
            fault = f"{edge} does not lie between exactly two faces of one orientation"
            raise FileError(path, f"the mesh is not closed: {fault}")
