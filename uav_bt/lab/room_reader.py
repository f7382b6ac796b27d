"""Reads the section `room` of a lab file: checks its names, classes, pictures and meshes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.lab.classes import LabClasses
from uav_bt.lab.obj_file import read_obj
from uav_bt.lab.picture import check_picture
from uav_bt.lab.roles import OBSTACLE
from uav_bt.lab.room import Room, RoomSection, Surface
from uav_bt.yaml_file import YamlFile

# Names in contacts and messages that objects cannot have.
CONTACT_NAMES: Final = (
    *("box", "mover", "mark", "drone"),
    *("floor", "ceiling", "wall", "ground", "take_off"),
)
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*")
_FILE: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_SECTION: Final = "room"

Steps = tuple[str, ...]


def read_room(file: YamlFile[Any], section: RoomSection, folder: Path, classes: LabClasses) -> Room:
    """Return the room that the section of a lab file describes, with its pictures and meshes."""
    meshes: dict[str, NDArray[np.float64]] = {}
    files: list[Path] = []
    at: Steps
    for name, kind in section.objects.items():
        steps: Steps = (_SECTION, "objects", name)
        if not _NAME.fullmatch(name):
            raise file.error(
                "the name of a kind consists of small letters, digits and _, and begins with a "
                "letter",
                *steps,
            )
        if name in CONTACT_NAMES:
            raise file.error(
                f"'{name}' is a name in reports of contacts: give the kind another name", *steps
            )
        _check_class(file, kind.class_name, classes, (*steps, "class"))
        if kind.file is not None:
            at = (*steps, "file")
            path = _inside(file, folder, kind.file, at)
            with file.at(*at):
                meshes[name] = read_obj(path, kind.size_m)
            files.append(path)
    for surface, steps in _surfaces(section):
        if surface.image is not None:
            at = (*steps, "image")
            path = _inside(file, folder, surface.image, at)
            with file.at(*at):
                check_picture(path)
            files.append(path)
    return Room(section=section, folder=folder, meshes=meshes, files=tuple(files))


def _check_class(file: YamlFile[Any], name: str, classes: LabClasses, steps: Steps) -> None:
    with file.at(*steps):
        class_id = classes.id_of(name)
    if class_id not in classes.of_role(OBSTACLE):
        role = next(each.role for each in classes if each.name == name)
        raise file.error(
            f"the class of an object must be an obstacle, and '{name}' has the role {role}", *steps
        )


def _inside(file: YamlFile[Any], folder: Path, name: str, steps: Steps) -> Path:
    """Return the path of a file in the lab's folder; links out of it are refused."""
    path = folder / name
    if not _FILE.fullmatch(name) or path.resolve().parent != folder.resolve():
        raise file.error(
            f"expected the name of a file in the lab's folder, without a path, got '{name}'", *steps
        )
    return path


def _surfaces(section: RoomSection) -> Iterator[tuple[Surface, Steps]]:
    """Yield all surfaces with their places in the file."""
    parts: list[tuple[Steps, object]]
    parts = [(("ground",), section.ground), (("walls",), section.walls)]
    parts += [(("objects", name), kind) for name, kind in section.objects.items()]
    for steps, part in parts:
        for key in ("surface", "floor", "top", "frame"):
            surface = getattr(part, key, None)
            if surface is not None:
                yield surface, (_SECTION, *steps, key)
