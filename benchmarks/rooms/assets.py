"""The folder of assets: furniture as closed meshes, and photographs, for training or for testing.

A library of Sweet Home 3D (`.sh3f`) is a ZIP archive with a catalogue and OBJ models, which are
open and far finer than a lab's mesh may be. Each becomes a few convex pieces (Wei et al.,
"Approximate Convex Decomposition for 3D Meshes", SIGGRAPH 2022; the package coacd).
"""

from __future__ import annotations

import json
import re
import zipfile
import zlib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, Final

import cv2
import numpy as np

from benchmarks.rooms.furnish import Assets, Furniture

USES: Final = ("train", "test")
LIST: Final = "furniture.json"
PHOTOGRAPH_PX: Final = 512
CATALOGUE: Final = "PluginFurnitureCatalog.properties"
HEIGHTS_M: Final = (0.3, 2.45)  # of furniture that stands on the floor
WIDEST_M: Final = 2.6
FINEST: Final = 40_000  # triangles; finer models take minutes
CONVEX: Final = {
    "threshold": 0.08,  # largest concavity that is left, relative
    "max_convex_hull": 20,
    "preprocess_resolution": 30,
    "resolution": 500,
    "mcts_nodes": 6,
    "mcts_iterations": 20,
    "mcts_max_depth": 2,
    "decimate": True,
    "max_ch_vertex": 48,
}


def load_assets(folder: Path, use: str) -> Assets:
    """Return the assets of a folder of `make_assets` for `train` or `test`."""
    furniture = [
        Furniture(path=folder / "furniture" / each["file"], size_m=tuple(each["size_m"]))
        for each in json.loads((folder / LIST).read_text(encoding="utf-8"))
        if each["use"] == use
    ]
    paths = sorted((folder / "pictures" / use).glob("*.jpg"))
    pictures = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in paths]
    if not furniture or not pictures:
        raise SystemExit(f"{folder}: no furniture or no pictures for {use}")
    return Assets(furniture=furniture, photographs=pictures)


def make_assets(library: Path, pictures: Path, out: Path) -> None:
    """Write a library's furniture as meshes, and smaller copies of the photographs."""
    (out / "furniture").mkdir(parents=True, exist_ok=True)
    listed = []
    with zipfile.ZipFile(library) as archive:
        for model, size_m, author in standing_models(archive):
            name = PurePosixPath(model).stem
            path = out / "furniture" / f"{name.lower()}.obj"
            if path.exists() or convert(archive.read(model).decode("latin-1"), path):
                use = USES[zlib.crc32(name.encode()) % 4 == 0]  # about every fourth for tests
                listed.append({"file": path.name, "size_m": size_m, "author": author, "use": use})
    (out / LIST).write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    for use in USES:
        (out / "pictures" / use).mkdir(parents=True, exist_ok=True)
        for source in sorted((pictures / use).iterdir()):
            image = cv2.imread(str(source))
            scale = min(1.0, PHOTOGRAPH_PX / max(image.shape[:2]))
            small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            target = out / "pictures" / use / f"{source.stem.lower()}.jpg"
            cv2.imwrite(str(target), small, [cv2.IMWRITE_JPEG_QUALITY, 85])


def standing_models(library: zipfile.ZipFile) -> Iterator[tuple[str, list[float], str]]:
    """Yield OBJ file, size in metres and author of the models that stand on the floor of a room."""
    text = library.read(CATALOGUE).decode("latin-1")
    entries: dict[str, dict[str, str]] = {}
    for key, number, value in re.findall(r"^(\w+)#(\d+)=(.*?)\s*$", text, re.MULTILINE):
        entries.setdefault(number, {})[key] = value
    for entry in entries.values():
        size_m = [float(entry[key]) / 100.0 for key in ("width", "depth", "height")]
        stands = float(entry.get("elevation", 0.0)) == 0.0 and entry["doorOrWindow"] == "false"
        fits = HEIGHTS_M[0] <= size_m[2] <= HEIGHTS_M[1] and max(size_m[:2]) <= WIDEST_M
        if stands and fits and min(size_m[:2]) >= 0.1:
            yield entry["model"].lstrip("/"), size_m, entry.get("creator", "")


def convert(text: str, path: Path) -> bool:
    """Write an OBJ model, y up, as convex pieces, z up; return whether it is coarse enough."""
    corners, triangles = _triangles(text)
    if len(triangles) > FINEST:
        return False
    import coacd  # noqa: PLC0415 - only this command needs it

    coacd.set_log_level("error")
    lines, first = [], 1
    for points, faces in coacd.run_coacd(coacd.Mesh(corners, triangles), **CONVEX):
        lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in points]
        lines += [f"f {a + first} {b + first} {c + first}" for a, b, c in faces]
        first += len(points)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return True


def _triangles(text: str) -> tuple[Any, Any]:
    """Return corners, (V, 3), and triangles, (N, 3), of an OBJ file."""
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
