"""Lab files, strict YAML: their reader, and their JSON schema for editors."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from uav_bt.lab.classes import Colour, LabClass, LabClasses, RoleName
from uav_bt.lab.flight_keys import FlightKeys, TeacherKeys, mark_of, mark_pose, take_off_pose
from uav_bt.lab.lab import LAB_FILE, Lab
from uav_bt.lab.room import RoomSection, check_name, read_room
from uav_bt.lab.surface import ColourText
from uav_bt.types.place_frames import area_problem
from uav_bt.types.sizes import Clearances
from uav_bt.yaml_file import YamlFile, read_yaml

VERSION: Final = 1


def read_lab(path: Path) -> Lab:
    """Read the lab file of a folder, or a lab file."""
    file = lab_text(path / LAB_FILE if path.is_dir() else path)
    value, folder = file.value, file.path.parent
    if value.version > VERSION:
        known = f"this program reads versions up to {VERSION}: update uav-bt"
        raise file.error(f"this lab is of version {value.version}, and {known}", "version")
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
        flight=_beside_walls(value),
        teacher=value.teacher,
        room=None if value.room is None else read_room(file, value.room, folder, classes),
    )


def _beside_walls(value: LabFile) -> LabFile:
    """Return keys with margins: walls at the edge of the ground count as obstacles do."""
    walls = None if value.room is None else value.room.walls
    if value.margins is not None or walls is None or walls.beside_m > 0.0:
        return value
    return replace(value, margins=Clearances(edge_m=Clearances.obstacle_m))


def lab_text(path: Path) -> YamlFile[LabFile]:
    """Return the text of a lab file, whose errors name their line."""
    return read_yaml(path, LabFile, "lab file", remedy="it states version and classes of a place")


def _classes(file: YamlFile[LabFile]) -> LabClasses:
    forms, room = file.value.classes, file.value.room
    built_m = {} if room is None else room.legs_m()
    sides = {name for name, each in forms.items() if each.role == "obstacle"}
    sides -= {each.top for each in forms.values()}
    with file.at("classes"):
        return LabClasses(
            LabClass(
                name=name,
                role=each.role,
                colour=_colour(each.colour),
                top=each.top,
                legs_m=each.legs_m or (built_m.get(name) if name in sides else None),
            )
            for name, each in forms.items()
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


class _Untitled(GenerateJsonSchema):
    def field_title_should_be_set(self, _: Any) -> bool:
        """Return that no field has a title, which would be its key again."""
        return False


def lab_schema() -> str:
    """Return the schema of lab files as JSON.

    YAML editors find it by a line at the head of a lab file:
    `# yaml-language-server: $schema=lab.schema.json`.
    """
    schema, shared = _schema(LabFile), _schema(FlightKeys)
    for name, part in shared["properties"].items():  # pydantic omits texts of inherited keys
        schema["properties"][name] = part
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps({**head, **schema, "title": "Lab file"}, indent=2) + "\n"


def _schema(form: Any) -> Any:
    config = ConfigDict(use_attribute_docstrings=True, extra="forbid")
    adapter = TypeAdapter(tuple[form], config=config)  # a dataclass takes no config by itself
    definitions = adapter.json_schema(schema_generator=_Untitled)["$defs"]
    for part in definitions.values():
        del part["title"]  # the name of a class
    return {"$defs": definitions, **definitions.pop(form.__name__)}
