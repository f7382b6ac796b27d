"""Reader of lab files: strict YAML; each mistake is reported with its file and line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import AfterValidator, Field

from uav_bt.errors import FileError
from uav_bt.lab.classes import Colour, LabClass, LabClasses, RoleName
from uav_bt.lab.drawn_area import area_problem
from uav_bt.lab.flight_keys import FlightKeys, TeacherKeys, mark_of, mark_pose, take_off_pose
from uav_bt.lab.lab import LAB_FILE, Lab
from uav_bt.lab.room import ColourText, RoomSection, check_name
from uav_bt.lab.room_reader import read_room
from uav_bt.yaml_file import YamlFile, read_yaml

VERSION: Final = 1


def read_lab(path: Path) -> Lab:
    """Read the lab file of a folder, or a lab file."""
    file = _read(path / LAB_FILE if path.is_dir() else path)
    value, folder = file.value, file.path.parent
    if value.version > VERSION:
        raise file.error(
            f"this lab is of version {value.version}, and this program reads versions up to "
            f"{VERSION}: update uav-bt",
            "version",
        )
    classes = _classes(file)
    with file.at("mark"):
        mark, pose = mark_of(value), mark_pose(value)
    for index, name in enumerate(value.ground):
        with file.at("ground", index):
            classes.id_of(name)
    with file.at("take_off"):
        take_off = take_off_pose(value)
    problem = area_problem(value.area, take_off=take_off, mark=pose) if value.area else None
    if problem is not None:
        raise file.error(problem, "area")
    return Lab(
        name=folder.resolve().name,
        folder=folder,
        file=file.path,
        classes=classes,
        mark=mark,
        mark_pose=pose,
        flight=value,
        teacher=value.teacher,
        room=None if value.room is None else read_room(file, value.room, folder, classes),
    )


def lab_error(file: Path, message: str, *steps: str | int) -> FileError:
    """Return an error about the value of a lab file that keys and indices lead to."""
    return _read(file).error(message, *steps)


def _read(path: Path) -> YamlFile[LabFile]:
    return read_yaml(path, LabFile, "lab file", remedy="it states version and classes of a place")


def _classes(file: YamlFile[LabFile]) -> LabClasses:
    with file.at("classes"):
        return LabClasses(
            LabClass(**{**vars(each), "name": name, "colour": _colour(each.colour)})
            for name, each in file.value.classes.items()
        )


def _colour(text: str) -> Colour:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue


# --- the form of the file -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Class:
    role: RoleName
    colour: ColourText
    """Colour in drawings."""
    top: str | None = None
    """Class of the level upper face."""
    legs_m: Annotated[float, Field(gt=0, le=10)] | None = None
    """Largest distance between two legs of an object, m."""


@dataclass(frozen=True, kw_only=True)
class LabFile(FlightKeys):
    """Form of a lab file."""

    version: Annotated[int, Field(ge=1)]
    """Version of the form: 1."""
    classes: Annotated[
        dict[Annotated[str, AfterValidator(check_name)], _Class], Field(min_length=1)
    ]
    """Classes by name; the order gives their ids."""
    teacher: TeacherKeys | None = None
    """Network that labels images for training, in place of picks."""
    room: RoomSection | None = None
    """What the twin builds; a real flight needs none."""
