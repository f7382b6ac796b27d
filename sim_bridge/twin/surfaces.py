"""Looks of a lab's surfaces as textures: pictures, and generators with fixed seeds."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin import textures
from sim_bridge.twin.textures import clouds, to_bytes
from uav_bt.errors import FileError
from uav_bt.files import read_bounded
from uav_bt.lab.surface import MAX_BYTES, Surface
from uav_bt.types.area import Point
from uav_bt.types.arrays import Image

_PX_PER_M: Final = 192.0  # of generated surfaces
_MOST_PX: Final = 4096  # of a side
_TILE_M: Final = (1.0, 1.0)  # of a picture that states none
_GREY: Final = "#969692"  # of concrete
_BROWN: Final = "#9a7444"  # of wood
_LARGE_TILE_M: Final = (4.0, 4.0)  # of concrete and carpet on walls and objects
_WOOD_TILE_M: Final = (1.2, 0.6)


@dataclass(frozen=True, kw_only=True)
class Paint:
    """A texture that is made when it is needed."""

    name: str
    make: Callable[[], Image]  # (H, W, 3) uint8 RGB, its first row at the top
    tile_m: Point  # width and height of one repetition


def paint_of(surface: Surface, folder: Path, whole_m: Point | None = None) -> Paint:
    """Return the texture of a surface, whose pictures lie in a folder.

    Carpet, concrete, lines, and a picture without `tile_m` cover a whole ground once.
    """
    name = f"{_seed(surface):08x}"
    if surface.image is None and surface.generator is None:
        name = f"plain-{name}"  # not that of paint
    once = surface.generator in ("carpet", "concrete")
    once |= surface.generator is None and surface.tile_m is None
    if whole_m is not None and (once or surface.lines):
        whole = partial(_ground, surface, folder, whole_m)
        return Paint(name=f"{name}-ground", make=whole, tile_m=whole_m)
    make, tile_m = _tile_of(surface, folder)
    return Paint(name=name, make=make, tile_m=tile_m)


def _seed(surface: Surface) -> int:
    if surface.generator == "paint":  # the seed of a time when it was the usual generator
        surface = replace(surface, generator=None)
    return zlib.crc32(repr(surface).encode())


def _tile_of(surface: Surface, folder: Path) -> tuple[Callable[[], Image], Point]:
    """Return a maker of a texture that repeats, and its width and height."""
    colour, seed = surface.colour, _seed(surface)
    if surface.image is not None:
        return partial(_picture, folder / surface.image), surface.tile_m or _TILE_M
    make: Callable[[], Image]
    match surface.generator:
        case None:
            make = partial(np.full, (16, 16, 3), _rgb(colour or _GREY), np.uint8)
        case "paint":
            make = partial(_paint, colour or _GREY, seed)
        case "carpet":
            return partial(textures.carpet, _LARGE_TILE_M), _LARGE_TILE_M
        case "concrete":
            return partial(_concrete_tile, colour or _GREY, seed), _LARGE_TILE_M
        case "wood":
            return partial(_wood, colour or _BROWN, seed), _WOOD_TILE_M
        case paper:
            return partial(textures.paper, paper), (textures.PAPER_TILE_M, textures.PAPER_TILE_M)
    return make, _TILE_M


def _ground(surface: Surface, folder: Path, whole_m: Point) -> Image:
    """Return the picture of a whole ground."""
    if surface.generator == "carpet":
        image = textures.carpet(whole_m)
    elif surface.generator is None and surface.image is None:
        image = _carpet(whole_m, surface.colour or _GREY, _seed(surface))
    elif surface.generator == "concrete":
        image = _concrete(whole_m, surface.colour or _GREY, _seed(surface))
    else:
        make, tile_m = _tile_of(surface, folder)
        stretched = surface.image is not None and surface.tile_m is None
        image = _laid(make(), whole_m if stretched else tile_m, whole_m)
    return _marked(image, surface, whole_m)


def _rgb(text: str) -> NDArray[np.float32]:
    return np.array(list(bytes.fromhex(text.removeprefix("#"))), np.float32)


def _pixels(size_m: Point) -> tuple[int, int]:
    """Return width and height in pixels."""
    scale = min(_PX_PER_M, _MOST_PX / max(size_m))
    return round(scale * size_m[0]), round(scale * size_m[1])


def _picture(path: Path) -> Image:
    data = np.frombuffer(read_bounded(path, MAX_BYTES), np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if image is None:
        raise FileError(path, "is a damaged picture")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


def _laid(tile: Image, tile_m: Point, whole_m: Point) -> Image:
    """Return a ground of repeated tiles, the middle of one in the middle of the ground."""
    sizes = zip(_pixels(whole_m), whole_m, tile_m, tile.shape[1::-1], strict=True)
    right, down = (
        (((np.arange(pixels) + 0.5) / pixels - 0.5) * side_m / each_m + 0.5) % 1.0 * texels
        for pixels, side_m, each_m, texels in sizes
    )
    return np.asarray(tile[np.ix_(down.astype(int), right.astype(int))], np.uint8)


def _carpet(size_m: Point, colour: str, seed: int) -> Image:
    """Return a carpet of one colour: short pile, whose threads differ in light."""
    rng = np.random.default_rng(seed)
    width, height = _pixels(size_m)
    light = 1.0 + rng.normal(0.0, 0.05, (height, width)).astype(np.float32)
    for cells_a_metre, weight in ((4.0, 0.02), (30.0, 0.04), (80.0, 0.06)):
        columns, rows = (max(2, round(cells_a_metre * side)) for side in size_m)
        light += weight * clouds(rng, (rows, columns), (width, height))
    return to_bytes(light[..., None] * _rgb(colour))


def _paint(colour: str, seed: int) -> Image:
    """Return paint with faint shading, 256 pixels square; its edges fit together."""
    rng = np.random.default_rng(seed)
    light = 1.0 + 0.03 * _mirrored(clouds(rng, (4, 4), (128, 128)))
    light += rng.normal(0.0, 0.012, light.shape)
    return to_bytes(_rgb(colour) * light[..., None])


def _concrete_tile(colour: str, seed: int) -> Image:
    """Return concrete whose edges fit together."""
    width_m, height_m = _LARGE_TILE_M
    return _mirrored(_concrete((width_m / 2, height_m / 2), colour, seed))


def _mirrored(image: NDArray[Any]) -> NDArray[Any]:
    """Return an image with its mirror images beside and below it."""
    wide = np.concatenate([image, image[:, ::-1]], axis=1)
    return np.concatenate([wide, wide[::-1]], axis=0)


def _concrete(size_m: Point, colour: str, seed: int) -> Image:
    """Return cast concrete: stains, pores, fine cracks, and grain at every scale."""
    rng = np.random.default_rng(seed)
    width, height = _pixels(size_m)
    light = np.ones((height, width), np.float32)
    for cells_a_metre, weight in ((0.7, 0.05), (3.0, 0.06), (12.0, 0.05), (48.0, 0.05)):
        columns, rows = (max(2, round(cells_a_metre * side)) for side in size_m)
        light += weight * clouds(rng, (rows, columns), (width, height))
    for _ in range(round(60 * size_m[0] * size_m[1])):  # pores and specks of gravel
        centre = int(rng.integers(width)), int(rng.integers(height))
        shade = float(rng.choice((0.62, 0.75, 1.22)))
        cv2.circle(light, centre, int(rng.integers(1, 4)), shade, cv2.FILLED, cv2.LINE_AA)
    for _ in range(max(1, round(0.4 * size_m[0] * size_m[1]))):  # cracks
        step = rng.normal(0.0, 0.06 * _PX_PER_M, (12, 2)) + rng.normal(0.0, 0.1 * _PX_PER_M, 2)
        way = np.cumsum(step, axis=0) + rng.uniform((0.0, 0.0), (width, height))
        cv2.polylines(light, [way.round().astype(np.int32)], False, 0.7, 1, cv2.LINE_AA)
    light += rng.normal(0.0, 0.02, light.shape).astype(np.float32)
    return to_bytes(light[..., None] * _rgb(colour))


def _wood(colour: str, seed: int) -> Image:
    """Return boards with grain along u, 1.2 m by 0.6 m."""
    rng = np.random.default_rng(seed)
    light = np.ones((256, 512), np.float32)
    for along, across, weight in ((4, 32, 0.10), (16, 128, 0.08)):
        light += weight * _mirrored(clouds(rng, (across // 2, along // 2), (256, 128)))
    boards = rng.uniform(0.85, 1.12, 4).astype(np.float32)
    light *= boards.repeat(64)[:, None]
    light[::64] *= 0.55  # gaps
    light += rng.normal(0.0, 0.015, light.shape).astype(np.float32)
    return to_bytes(light[..., None] * _rgb(colour))


def _marked(image: Image, surface: Surface, whole_m: Point) -> Image:
    """Return a ground with its painted lines, a little worn."""
    if not surface.lines:
        return image
    height, width = image.shape[:2]
    scale = np.array((width / whole_m[0], height / whole_m[1]))
    rng = np.random.default_rng(len(surface.lines))
    worn = clouds(rng, (height // 24 + 2, width // 24 + 2), (width, height))
    result = image.astype(np.float32)
    for line in surface.lines:
        points = np.array(line.points_m) * (1.0, -1.0) + np.array(whole_m) / 2
        pixels = (points * scale).round().astype(np.int32)
        mask, thick = np.zeros((height, width), np.uint8), round(line.width_m * scale.mean())
        cv2.polylines(mask, [pixels], False, 255, max(1, thick), cv2.LINE_AA)
        cover = (mask / np.float32(255.0) * (0.88 + 0.06 * worn))[..., None]
        result += cover * (_rgb(line.colour) - result)
    return to_bytes(result)
