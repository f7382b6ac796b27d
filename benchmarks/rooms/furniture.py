"""Furniture of generated rooms: closed meshes made from a library of Sweet Home 3D.

A library (`.sh3f`) is a ZIP archive with a catalogue and OBJ models, which are open and far finer
than a lab's mesh may be. Each model becomes a few convex pieces (Wei et al., "Approximate Convex
Decomposition for 3D Meshes with Collision-Aware Concavity", SIGGRAPH 2022; the package coacd).
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Final

import coacd
import numpy as np
from numpy.typing import NDArray

CATALOGUE: Final = "PluginFurnitureCatalog.properties"
HEIGHTS_M: Final = (0.3, 2.45)  # of furniture that stands on the floor
WIDEST_M: Final = 2.6
PIECES: Final = 20
CORNERS: Final = 48  # of one piece
CONCAVITY: Final = 0.08  # largest that is left, relative
FINEST: Final = 40_000  # triangles; finer models take minutes


@dataclass(frozen=True, kw_only=True)
class Model:
    """One model of a library.

    Attributes:
        name: Name of its file without the ending.
        size_m: Length, width and height.
        author: Its author, where the library states one.
        path: Its OBJ file in the archive.
    """

    name: str
    size_m: tuple[float, float, float]
    author: str
    path: str


def list_models(library: zipfile.ZipFile) -> Iterator[Model]:
    """Yield the models of a library that stand on the floor of a room.

    Args:
        library: The archive.
    """
    text = library.read(CATALOGUE).decode("latin-1")
    entries: dict[str, dict[str, str]] = {}
    for key, number, value in re.findall(r"^(\w+)#(\d+)=(.*?)\s*$", text, re.MULTILINE):
        entries.setdefault(number, {})[key] = value
    for entry in entries.values():
        size_m = tuple(float(entry[key]) / 100.0 for key in ("width", "depth", "height"))
        stands = float(entry.get("elevation", 0.0)) == 0.0 and entry["doorOrWindow"] == "false"
        fits = HEIGHTS_M[0] <= size_m[2] <= HEIGHTS_M[1] and max(size_m[:2]) <= WIDEST_M
        if stands and fits and min(size_m[:2]) >= 0.1:
            path = PurePosixPath(entry["model"].lstrip("/"))
            yield Model(
                name=path.stem,
                size_m=(size_m[0], size_m[1], size_m[2]),
                author=entry.get("creator", ""),
                path=str(path),
            )


def convert(library: zipfile.ZipFile, model: Model, path: Path) -> bool:
    """Write a model as closed convex pieces; return whether it is coarse enough.

    Args:
        library: The archive.
        model: One of its models.
        path: The OBJ file to write.
    """
    corners, triangles = read_triangles(library.read(model.path).decode("latin-1"))
    if len(triangles) > FINEST:
        return False
    write_obj(path, convex_pieces(corners, triangles))
    return True


def read_triangles(text: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the corners, (V, 3), z up, and triangles, (N, 3), of an OBJ file.

    Args:
        text: The file's text; the models have y up.
    """
    corners, triangles = [], []
    for line in text.splitlines():
        key, *words = line.split() or ("",)
        if key == "v":
            x, y, z = map(float, words[:3])
            corners.append((x, -z, y))
        elif key == "f":
            face = [int(word.partition("/")[0]) for word in words]
            face = [each - 1 if each > 0 else len(corners) + each for each in face]
            triangles += [(face[0], a, b) for a, b in pairwise(face[1:])]
    return np.array(corners), np.array(triangles)


def convex_pieces(
    corners: NDArray[np.float64], triangles: NDArray[np.int64]
) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Return closed convex pieces, corners and triangles each, that together fill a model.

    Args:
        corners: (V, 3).
        triangles: (N, 3).
    """
    coacd.set_log_level("error")
    return list(
        coacd.run_coacd(
            coacd.Mesh(corners, triangles),
            threshold=CONCAVITY,
            max_convex_hull=PIECES,
            preprocess_resolution=30,
            resolution=500,
            mcts_nodes=6,
            mcts_iterations=20,
            mcts_max_depth=2,
            decimate=True,
            max_ch_vertex=CORNERS,
        )
    )


def write_obj(path: Path, pieces: list[tuple[NDArray[np.float64], NDArray[np.int64]]]) -> None:
    """Write pieces to an OBJ file."""
    lines, first = [], 1
    for corners, triangles in pieces:
        lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in corners]
        lines += [f"f {a + first} {b + first} {c + first}" for a, b, c in triangles]
        first += len(corners)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
