"""The folder of assets: furniture and photographs, each for training or for testing."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Final

import cv2

from benchmarks.rooms.furnish import Assets, Furniture

USES: Final = ("train", "test")
LIST: Final = "furniture.json"
PHOTOGRAPH_PX: Final = 512


def use_of(name: str) -> str:
    """Return `test` for about every fourth model, by its name, else `train`."""
    return "test" if zlib.crc32(name.encode()) % 4 == 0 else "train"


def load_assets(folder: Path, use: str) -> Assets:
    """Return the assets of a folder for training or for testing.

    Args:
        folder: Written by `make_assets`.
        use: `train` or `test`.
    """
    listed = json.loads((folder / LIST).read_text(encoding="utf-8"))
    furniture = [
        Furniture(path=folder / "furniture" / each["file"], size_m=tuple(each["size_m"]))
        for each in listed
        if each["use"] == use
    ]
    paths = sorted((folder / "pictures" / use).glob("*.jpg"))
    pictures = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in paths]
    if not furniture or not pictures:
        raise SystemExit(f"{folder}: no furniture or no pictures for {use}")
    return Assets(furniture=furniture, photographs=pictures)


def make_assets(library: Path, pictures: Path, out: Path) -> None:
    """Write furniture as closed meshes, and photographs at one size; meshes that exist are kept.

    Args:
        library: Library of furniture, `.sh3f`.
        pictures: Folders `train` and `test` with photographs of materials.
        out: Folder of the assets.
    """
    # Late: only this command needs coacd.
    from benchmarks.rooms import furniture  # noqa: PLC0415

    (out / "furniture").mkdir(parents=True, exist_ok=True)
    listed = []
    with zipfile.ZipFile(library) as archive:
        for model in furniture.list_models(archive):
            path = out / "furniture" / f"{model.name.lower()}.obj"
            if not path.exists() and not furniture.convert(archive, model, path):
                continue
            entry = {"file": path.name, "size_m": model.size_m, "author": model.author}
            listed.append({**entry, "use": use_of(model.name)})
    (out / LIST).write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    for use in USES:
        (out / "pictures" / use).mkdir(parents=True, exist_ok=True)
        for source in sorted((pictures / use).iterdir()):
            image = cv2.imread(str(source))
            scale = min(1.0, PHOTOGRAPH_PX / max(image.shape[:2]))
            small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            target = out / "pictures" / use / f"{source.stem.lower()}.jpg"
            cv2.imwrite(str(target), small, [cv2.IMWRITE_JPEG_QUALITY, 85])
