"""Reads the section `room` of a lab file: checks its classes, pictures and meshes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import read_bounded
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.obj_file import read_obj
from uav_bt.lab.room import Room, RoomSection, Surface
from uav_bt.yaml_file import Steps, YamlFile

_FILE: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


def read_room(file: YamlFile[Any], section: RoomSection, folder: Path, classes: LabClasses) -> Room:
    """Return the room that the section of a lab file describes, with its pictures and meshes."""
    meshes: dict[str, NDArray[np.float64]] = {}
    files: list[Path] = []
    for name, kind in section.objects.items():
        with file.at("room", "objects", name, "class"):
            _check_class(kind.class_name, classes)
        if kind.file is not None:
            with file.at("room", "objects", name, "file"):
                files.append(_inside(folder, kind.file))
                meshes[name] = read_obj(files[-1], kind.size_m)
    for surface, steps in _surfaces(section):
        if surface.image is not None:
            with file.at("room", *steps, "image"):
                files.append(_inside(folder, surface.image))
                check_picture(files[-1])
    return Room(section=section, folder=folder, meshes=meshes, files=tuple(files))


def _check_class(name: str, classes: LabClasses) -> None:
    role = [*classes][classes.id_of(name)].role
    if role != "obstacle":
        raise ValueRangeError(
            f"the class of an object must be an obstacle, and '{name}' has the role {role}"
        )


def _inside(folder: Path, name: str) -> Path:
    """Return the path of a file in the lab's folder; links out of it are refused."""
    path = folder / name
    if not _FILE.fullmatch(name) or path.resolve().parent != folder.resolve():
        raise ValueRangeError(
            f"expected the name of a file in the lab's folder, without a path, got '{name}'"
        )
    return path


def _surfaces(section: RoomSection) -> Iterator[tuple[Surface, Steps]]:
    """Yield all surfaces with their places in the section."""
    parts: dict[Steps, object] = {("ground",): section.ground, ("walls",): section.walls}
    parts |= {("objects", name): kind for name, kind in section.objects.items()}
    for steps, part in parts.items():
        for key in ("surface", "floor", "top", "frame"):
            surface = getattr(part, key, None)
            if surface is not None:
                yield surface, (*steps, key)


MAX_SIDE_PX: Final = 4096
MAX_BYTES: Final = 8_000_000
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JPEG: Final = b"\xff\xd8\xff"
_NO_SIZE: Final = (0xC4, 0xC8, 0xCC)  # JPEG segments among those of sizes that have none


def check_picture(path: Path) -> None:
    """Refuse a file that is no picture, or a large one."""
    data = read_bounded(path, MAX_BYTES)
    size_px = _png_size(data) if data.startswith(_PNG) else _jpeg_size(data)
    if size_px is None or min(size_px) < 1:
        raise FileError(path, "is no picture: expected a PNG or JPEG file")
    if max(size_px) > MAX_SIDE_PX:
        raise FileError(
            path,
            f"is a picture of {size_px[0]}x{size_px[1]} pixels: at most {MAX_SIDE_PX} a side, "
            "make it smaller",
        )


def _png_size(data: bytes) -> tuple[int, int] | None:
    if data[12:16] != b"IHDR" or len(data) < 24:
        return None
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return the size in the first frame header; None without one."""
    if not data.startswith(_JPEG):
        return None
    place = 2
    while place + 9 <= len(data) and data[place] == 0xFF:
        kind = data[place + 1]
        if 0xC0 <= kind <= 0xCF and kind not in _NO_SIZE:
            high, wide = data[place + 5 : place + 7], data[place + 7 : place + 9]
            return int.from_bytes(wide, "big"), int.from_bytes(high, "big")
        place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    return None
