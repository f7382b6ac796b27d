"""The section `room` of a lab file, from which the twin builds the place, and its reader.

A real flight does not need it. Lengths are metres; the origin is the middle of the ground, z is up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import OUTSIDE, LabClasses
from uav_bt.lab.obj_file import read_obj
from uav_bt.lab.surface import MAX_CORNERS, Surface, Vector2, check_picture
from uav_bt.types.area import Area
from uav_bt.yaml_file import Steps, YamlFile

GROUND_SIDES_M: Final = (2.0, 40.0)
MAX_LAMPS: Final = 7  # OpenGL has eight lights
_Solid = Literal["box", "cylinder", "mesh", "table", "round_table", "rack"]
_Furniture = Literal["chair", "shelf", "cabinet", "person", "door", "window"]
ShapeName = Literal[_Solid, _Furniture]
ROUND: Final = "cylinder", "round_table"
ON_POSTS: Final = "table", "round_table", "rack"  # of a stated width
ON_LEGS: Final = (*ON_POSTS, "chair")
ON_WALL: Final = "door", "window"
# Names in contacts and messages that kinds of objects cannot have.
_TAKEN: Final = {"box", "mover", "mark", "drone", "floor", "ceiling", "wall", "ground", "take_off"}


def check_name(value: str) -> str:
    """Refuse a text that cannot be the name of a class or of a kind of objects."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", value):
        raise ValueRangeError("a name has small letters, digits and _, and begins with a letter")
    return value


def _check_kind(value: str) -> str:
    if value in _TAKEN:
        raise ValueRangeError(f"'{value}' is a name in reports of contacts: choose another name")
    return check_name(value)


_KindName = Annotated[str, AfterValidator(_check_kind)]
_Side = Annotated[float, Field(ge=0.02, le=10.0)]
_Outline = Annotated[tuple[Vector2, ...], Field(min_length=3, max_length=MAX_CORNERS)]


@dataclass(frozen=True, kw_only=True)
class GroundSection:
    """The ground below the flight: a rectangle around the origin, or a polygon."""

    size_m: Vector2 | None = None
    """Sides of the rectangle along x and y."""
    outline_m: _Outline | None = None
    """Corners of the polygon in order, in place of `size_m`."""
    surface: Surface = field(default_factory=lambda: Surface(colour="#8d949c"))
    """Its look; by default a grey carpet."""

    def __post_init__(self) -> None:
        if (self.size_m is None) == (self.outline_m is None):
            raise ValueRangeError("the ground needs either size_m or outline_m")
        if self.outline_m is not None:
            Area((self.outline_m,))  # refuses any other shape than a polygon
        low, high = GROUND_SIDES_M
        if not all(low <= side <= high for side in self.extent_m):
            expected = f"{low:g} to {high:g} m a side around the origin"
            raise ValueRangeError(f"the ground must measure {expected}, got {list(self.extent_m)}")

    @property
    def extent_m(self) -> Vector2:
        """Sides of the least rectangle around the origin that holds the ground."""
        if self.size_m is not None:
            return self.size_m
        corners = self.outline_m or ()
        return 2.0 * max(abs(x_m) for x_m, _ in corners), 2.0 * max(abs(y_m) for _, y_m in corners)


@dataclass(frozen=True, kw_only=True)
class WallSection:
    """Walls, floor beside the ground, and ceiling."""

    height_m: Annotated[float, Field(ge=2.0, le=20.0)] = 5.0
    """Height of the walls."""
    beside_m: Annotated[float, Field(ge=0.0, le=10.0)] = 2.5
    """Distance from the ground to the walls. At 0 they follow its outline; otherwise they are a
    rectangle around it.
    """
    surface: Surface | None = None
    """Look of the walls; by default light grey."""
    floor: Surface | None = None
    """Look of the floor beside the ground; by default grey."""


@dataclass(frozen=True, kw_only=True)
class Lamp:
    """A lamp that shines downwards from a place, brightest below it."""

    position_m: tuple[float, float, Annotated[float, Field(gt=0.0)]]
    """World x, y and z."""
    brightness: Annotated[float, Field(ge=0.0, le=5.0)] = 1.0
    """Light at the lamp; 1 shows a surface straight below it in its own colours."""
    reach_m: Annotated[float, Field(ge=0.5, le=50.0)] = 4.0
    """Distance at which half of the light is left."""


@dataclass(frozen=True, kw_only=True)
class LightSection:
    """The light of the place."""

    ambient: Annotated[float, Field(ge=0.0, le=1.0)] = 0.35
    """Share of light without a direction, 0 to 1."""
    lamps: Annotated[tuple[Lamp, ...], Field(min_length=1, max_length=MAX_LAMPS)]
    """Lamps at the ceiling."""


_UNSTATED, _WOOD = Surface(generator="wood"), Surface(generator="wood")
_NO_SIZE: Final = (0.0, 0.0, 0.0)
_USUAL: Final[dict[str, dict[str, Any]]] = {
    shape: {
        "size_m": size_m,
        "surface": Surface(colour=colour) if colour else _WOOD,
        "frame": Surface(colour=frame) if frame else None,
        "above_floor_m": 0.9 if shape == "window" else None,
    }
    for shape, size_m, colour, frame in (
        ("table", (1.4, 0.7, 0.74), None, "#4a4f54"),
        ("round_table", (1.0, 1.0, 0.74), "#ece9e2", "#4a4f54"),
        ("rack", (1.2, 0.4, 2.0), None, "#4a4f54"),
        ("chair", (0.46, 0.5, 0.9), "#35586f", "#2f3134"),
        ("shelf", (0.9, 0.32, 1.8), None, "#7d5f3a"),
        ("cabinet", (0.8, 0.42, 1.1), "#d5d8da", None),
        ("door", (0.95, 0.05, 2.05), "#8a5a34", "#efece4"),
        ("window", (1.3, 0.06, 1.2), "#9fd0f0", "#fafaf8"),
        ("person", (0.5, 0.3, 1.75), "#2d6cb5", "#d9a583"),
    )
}


@dataclass(frozen=True, kw_only=True)
class ObjectKind:
    """A kind of object that scenes place."""

    class_name: Annotated[str, Field(alias="class")] = ""
    """Class of its surfaces; the key is `class`. The upper face has the class's top. Only a door
    and a window need none: they have the class of the walls.
    """
    shape: ShapeName
    """`table`, `round_table` and `chair` stand on four legs; a `rack` has shelves between posts, a
    `shelf` a back and sides. `door` and `window` are flat on a wall.
    """
    size_m: tuple[_Side, _Side, _Side] = field(default_factory=lambda: _NO_SIZE)
    """Length, width and height; furniture has a usual size. A cylinder is as wide as long."""
    surface: Surface = field(default_factory=lambda: _UNSTATED)
    """Look of the whole, or of boards and shelves; furniture has a usual one."""
    top: Surface | None = None
    """Look of the upper face, if it differs."""
    frame: Surface | None = None
    """Look of legs, posts, frames, the back of a shelf, and a person's skin, if it differs."""
    board_m: Annotated[float, Field(ge=0.005)] = 0.03
    """Thickness of boards and shelves."""
    post_m: Annotated[float, Field(ge=0.01)] = 0.05
    """Width of legs and posts."""
    shelves: Annotated[int, Field(ge=1, le=12)] = 4
    """Number of boards of a rack or shelf."""
    above_floor_m: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """Height of the lower edge of a door or window; by default 0 and 0.9 m."""
    file: str | None = None
    """Name of the OBJ file of a mesh, in the lab's folder. It is scaled to `size_m`."""
    moves: bool = False
    """Whether `--movers` may draw movers of this kind."""

    def __post_init__(self) -> None:
        self._fill_in()
        if self.shape in ROUND and self.size_m[0] != self.size_m[1]:
            expected = "size_m must begin with two equal numbers"
            got = list(self.size_m)
            raise ValueRangeError(f"a {self.shape} is as wide as it is long: {expected}, got {got}")
        if (self.file is None) == (self.shape == "mesh"):
            raise ValueRangeError("a mesh needs 'file', an OBJ file; other shapes have none")
        if self.top is not None and self.shape in (*ON_WALL, "mesh", "person"):
            raise ValueRangeError(f"a {self.shape} has no upper face of its own: remove 'top'")
        if self.frame is not None and self.shape in ("box", "cylinder", "cabinet", "mesh"):
            raise ValueRangeError(f"a {self.shape} has no legs, posts or frame: remove 'frame'")
        if any(each is not None and each.lines for each in (self.surface, self.top, self.frame)):
            raise ValueRangeError("only the ground has painted lines")
        if self.shape in ON_WALL and self.moves:
            raise ValueRangeError(f"a {self.shape} does not move: remove 'moves'")
        if self.above_floor_m is not None and self.shape not in ON_WALL:
            raise ValueRangeError(f"a {self.shape} stands on the floor: remove 'above_floor_m'")
        if self.shape in ON_POSTS and self.post_m > min(self.size_m[:2]) / 3:
            raise ValueRangeError(f"post_m: at most a third of the width, got {self.post_m:g}")
        boards = self.shelves if self.shape in ("rack", "shelf") else 1
        if self.shape in (*ON_POSTS, "shelf") and self.board_m > self.size_m[2] / (2 * boards):
            most = "half of the height between boards"
            raise ValueRangeError(f"board_m: at most {most}, got {self.board_m:g}")

    def _fill_in(self) -> None:
        """Set what the kind does not state: furniture has a usual size and look."""
        usual = _USUAL.get(self.shape, {})
        if self.surface is not _UNSTATED and self.shape in ("table", "rack"):
            usual = {**usual, "frame": None}
        unstated = {"size_m": _NO_SIZE, "surface": _UNSTATED, "frame": None, "above_floor_m": None}
        for key in (key for key, missing in unstated.items() if getattr(self, key) is missing):
            object.__setattr__(self, key, usual.get(key, unstated[key]))
        lacks = {"size_m": self.size_m is _NO_SIZE, "surface": self.surface is _UNSTATED}
        lacks["class"] = not self.class_name and self.shape not in ON_WALL
        for key in (each for each, is_missing in lacks.items() if is_missing):
            raise ValueRangeError(f"lacks the key '{key}', which a {self.shape} needs")


@dataclass(frozen=True, kw_only=True)
class RoomSection:
    """Form of the section `room`. Keys that are absent are as in the paper's lab."""

    ground: GroundSection | None = None
    """The ground; without it scenes state its size."""
    walls: WallSection | None = None
    """Walls, floor and ceiling."""
    light: LightSection | None = None
    """The light of scenes without `lighting`."""
    objects: Mapping[_KindName, ObjectKind] = field(default_factory=dict)
    """Kinds of objects by name."""

    def legs_m(self) -> dict[str, float]:
        """Return the largest distance between legs by class, where all its kinds stand on legs."""
        kinds, found_m = self.objects.values(), dict[str, float]()
        other = {kind.class_name for kind in kinds if kind.shape not in ON_LEGS or kind.moves}
        for kind in kinds:
            if kind.class_name not in other:
                apart_m = math.hypot(*kind.size_m[:2])
                if kind.shape in ROUND:
                    apart_m = kind.size_m[0]
                found_m[kind.class_name] = max(apart_m, found_m.get(kind.class_name, 0.0))
        return found_m


@dataclass(frozen=True, kw_only=True)
class Room:
    """A room that was read and checked."""

    section: RoomSection
    folder: Path  # of the lab
    # Triangles of each kind of mesh, (N, 3, 3) metres, from the middle of its base.
    meshes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    files: tuple[Path, ...] = ()  # pictures and meshes that the section names


_FILE: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


def read_room(file: YamlFile[Any], section: RoomSection, folder: Path, classes: LabClasses) -> Room:
    """Return the room that the section of a lab file describes, with its pictures and meshes."""
    meshes: dict[str, NDArray[np.float64]] = {}
    files: list[Path] = []
    for name, kind in section.objects.items():
        with file.at("room", "objects", name, "class"):
            _check_class(kind, classes)
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


def _check_class(kind: ObjectKind, classes: LabClasses) -> None:
    name = kind.class_name or classes.names[OUTSIDE]
    role = [*classes][classes.id_of(name)].role
    if role != "obstacle" and not (role == "outside" and kind.shape in ON_WALL):
        raise ValueRangeError(
            f"an object's class must be an obstacle; '{name}' has the role {role}"
        )


def _inside(folder: Path, name: str) -> Path:
    """Return the path of a file in the lab's folder; links out of it are refused."""
    path = folder / name
    if not _FILE.fullmatch(name) or path.resolve().parent != folder.resolve():
        raise ValueRangeError(f"expected a file in the lab's folder, without a path, got '{name}'")
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
