"""Looks of surfaces: generators with a colour, and pictures, which are checked by their header."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal, get_args

from pydantic import Field

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import read_bounded

Vector2 = tuple[float, float]
ColourText = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]

MAX_CORNERS: Final = 64
SidePaper = Literal["dots", "leaves", "waves", "zigzag", "stars", "triangles", "checks", "confetti"]
RoofPaper = Literal["rings", "bars", "crosses", "spots", "diamonds"]
SIDE_PAPERS: Final[tuple[SidePaper, ...]] = get_args(SidePaper)
ROOF_PAPERS: Final[tuple[RoofPaper, ...]] = get_args(RoofPaper)


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
    """`paint`, `concrete` and `wood` vary the colour; `carpet` is the paper's, and the others are
    its printed papers. Without it a surface is plain, and the ground a carpet of one colour.
    """
    colour: ColourText | None = None
    """Colour of the surface; without a generator and for `paint` it is needed."""
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
