"""The section `room` of a lab file, from which the twin builds the place, and its reader.

A real flight does not need it. Lengths are metres; the origin is the middle of the ground, z is up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import read_bounded
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.obj_file import read_obj
from uav_bt.types.area import Area
from uav_bt.yaml_file import Steps, YamlFile

Vector2 = tuple[float, float]
ColourText = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]

GROUND_SIDES_M: Final = (2.0, 40.0)
MAX_CORNERS: Final = 64
MAX_LAMPS: Final = 7  # OpenGL has eight lights
ON_LEGS: Final = "table", "rack"  # shapes
SidePaper = Literal["dots", "leaves", "waves", "zigzag", "stars", "triangles", "checks", "confetti"]
RoofPaper = Literal["rings", "bars", "crosses", "spots", "diamonds"]
SIDE_PAPERS: Final[tuple[SidePaper, ...]] = get_args(SidePaper)
ROOF_PAPERS: Final[tuple[RoofPaper, ...]] = get_args(RoofPaper)
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


@dataclass(frozen=True, kw_only=True)
class PaintedLine:
    """A painted line on the ground."""

    points_m: Annotated[tuple[Vector2, ...], Field(min_length=2, max_length=MAX_CORNERS)]
    """Its corners, world x and y."""
    width_m: Annotated[float, Field(ge=0.01, le=2.0)] = 0.1
    """Its width."""
    colour: ColourText = "#d9b526"
    """Its colour."""


@dataclass(frozen=True, kw_only=True)
class Surface:
    """How a surface looks: a picture, or a generator with a colour."""

    generator: Literal["paint", "concrete", "wood", "carpet"] | SidePaper | RoofPaper | None = None
    """`paint` has one colour, `concrete` and `wood` vary it; `carpet` is the paper's, and the
    others are its printed papers.
    """
    colour: ColourText | None = None
    """Colour of the generator; `paint` needs one."""
    image: str | None = None
    """Name of a PNG or JPEG file in the lab's folder, in place of a generator."""
    tile_m: tuple[Annotated[float, Field(ge=0.02)], Annotated[float, Field(ge=0.02)]] | None = None
    """Width and height of one repetition of the picture; by default 1 m each way, and the whole
    ground.
    """
    lines: Annotated[tuple[PaintedLine, ...], Field(max_length=200)] = ()
    """Painted lines; only on the ground."""

    def __post_init__(self) -> None:
        if self.image is not None and (self.generator is not None or self.colour is not None):
            raise ValueRangeError("a surface has an image, or a generator with a colour, not both")
        if self.image is None and self.tile_m is not None:
            raise ValueRangeError("tile_m is the size of an image, and there is none: add 'image'")
        if self.image is None and self.generator in (None, "paint") and self.colour is None:
            raise ValueRangeError('a painted surface needs a colour, as "#b0b4b8", or an image')
        if self.colour and self.generator not in (None, "paint", "concrete", "wood"):
            raise ValueRangeError(f"'{self.generator}' has its own colours: remove 'colour'")


_Outline = Annotated[tuple[Vector2, ...], Field(min_length=3, max_length=MAX_CORNERS)]


@dataclass(frozen=True, kw_only=True)
class GroundSection:
    """The ground below the flight: a rectangle around the origin, or a polygon."""

    size_m: Vector2 | None = None
    """Sides of the rectangle along x and y."""
    outline_m: _Outline | None = None
    """Corners of the polygon in order, in place of `size_m`."""
    surface: Surface = field(default_factory=lambda: Surface(generator="carpet"))
    """Its look; by default the paper's carpet."""

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


@dataclass(frozen=True, kw_only=True)
class ObjectKind:
    """A kind of object that scenes place."""

    class_name: Annotated[str, Field(alias="class")]
    """Class of its surfaces; the key is `class`. The upper face has the class's top."""
    shape: Literal["box", "cylinder", "table", "rack", "mesh"]
    """`box`, `cylinder`, `table` (a board on four legs), `rack` (shelves between four posts), or
    `mesh`.
    """
    size_m: tuple[_Side, _Side, _Side]
    """Length, width and height; a cylinder is as wide as long."""
    surface: Surface
    """Look of the whole, or of boards and shelves."""
    top: Surface | None = None
    """Look of the upper face, if it differs."""
    frame: Surface | None = None
    """Look of legs and posts, if it differs."""
    board_m: Annotated[float, Field(ge=0.005)] = 0.03
    """Thickness of boards and shelves."""
    post_m: Annotated[float, Field(ge=0.01)] = 0.05
    """Width of legs and posts."""
    shelves: Annotated[int, Field(ge=1, le=12)] = 4
    """Number of shelves of a rack."""
    file: str | None = None
    """Name of the OBJ file of a mesh, in the lab's folder. It is scaled to `size_m`."""
    moves: bool = False
    """Whether `--movers` may draw movers of this kind."""

    def __post_init__(self) -> None:
        if self.shape == "cylinder" and self.size_m[0] != self.size_m[1]:
            expected = "size_m must begin with two equal numbers"
            got = list(self.size_m)
            raise ValueRangeError(f"a cylinder is as wide as it is long: {expected}, got {got}")
        if (self.file is None) == (self.shape == "mesh"):
            raise ValueRangeError("a mesh needs 'file', an OBJ file; other shapes have none")
        if self.shape == "mesh" and self.top is not None:
            raise ValueRangeError("a mesh has one surface: remove 'top'")
        if self.frame is not None and self.shape not in ON_LEGS:
            raise ValueRangeError(f"a {self.shape} has no legs or posts: remove 'frame'")
        if any(each is not None and each.lines for each in (self.surface, self.top, self.frame)):
            raise ValueRangeError("only the ground has painted lines")
        if self.shape not in ON_LEGS:
            return
        if self.post_m > min(self.size_m[:2]) / 3:
            raise ValueRangeError(f"post_m: at most a third of the width, got {self.post_m:g}")
        boards = self.shelves if self.shape == "rack" else 1
        if self.board_m > self.size_m[2] / (2 * boards):
            most = "half of the height between boards"
            raise ValueRangeError(f"board_m: at most {most}, got {self.board_m:g}")


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
        found = f"is a picture of {size_px[0]}x{size_px[1]} pixels"
        raise FileError(path, f"{found}: at most {MAX_SIDE_PX} a side, make it smaller")


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
