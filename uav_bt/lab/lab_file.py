"""Reader of lab files: strict YAML; each mistake is reported with its file and line."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from uav_bt.errors import InputError, UnknownNameError, ValueRangeError
from uav_bt.lab.classes import Colour, LabClass, LabClasses
from uav_bt.lab.lab import LAB_FILE, Lab
from uav_bt.lab.mark_section import WholeMarkSection, mark_of_section
from uav_bt.lab.roles import RoleName
from uav_bt.lab.room import RoomSection
from uav_bt.lab.room_reader import read_room
from uav_bt.types.landing_mark import LandingMark
from uav_bt.yaml_file import YamlFile, read_yaml

VERSION: Final = 1

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def read_lab(path: Path) -> Lab:
    """Read the lab file of a folder.

    Args:
        path: The folder, or the lab file.

    Raises:
        FileError: The file is absent, malformed, or of a newer version.
    """
    path = path / LAB_FILE if path.is_dir() else path
    file = read_yaml(path, _LabFile, "lab file", remedy="`uav-bt lab new NAME` makes one")
    if file.value.version > VERSION:
        raise file.error(
            f"this lab is of version {file.value.version}, and this program reads versions up to "
            f"{VERSION}: update uav-bt",
            "version",
        )
    classes, room = _classes(file), file.value.room
    return Lab(
        name=path.parent.resolve().name,
        folder=path.parent,
        classes=classes,
        mark=_mark(file),
        room=None if room is None else read_room(file, room, path.parent, classes),
    )


def _classes(file: YamlFile[_LabFile]) -> LabClasses:
    for name in file.value.classes:
        if not _NAME.fullmatch(name):
            raise file.error(
                "a class name consists of small letters, digits and _, and begins with a letter",
                "classes",
                name,
            )
    listed = [
        LabClass(name=name, role=each.role, colour=_colour(each.colour), top=each.top)
        for name, each in file.value.classes.items()
    ]
    try:
        return LabClasses(listed)
    except (UnknownNameError, ValueRangeError) as error:
        raise file.error(str(error), "classes") from error


def _mark(file: YamlFile[_LabFile]) -> LandingMark | None:
    section = file.value.mark
    try:
        return None if section is None else mark_of_section(section)
    except InputError as error:
        raise file.error(str(error), "mark") from error


def _colour(text: str) -> Colour:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue


# --- the form of the file -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Class:
    role: RoleName
    colour: Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
    top: str | None = None


@dataclass(frozen=True, kw_only=True)
class _LabFile:
    version: Annotated[int, Field(ge=1)]
    classes: Annotated[dict[str, _Class], Field(min_length=1)]
    mark: WholeMarkSection | None = None
    room: RoomSection | None = None
