"""Textures of the boxes, the carpet and the pad, generated from fixed seeds.

Each pattern is a square tile of known size in metres that repeats seamlessly. A pattern has two or
three hues, mixed so finely that a window of a few centimetres contains all of them. Colour
histograms then distinguish the patterns, as they do for printed wrapping paper.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.lab.surface import ROOF_PAPERS, SIDE_PAPERS
from uav_bt.types.arrays import Image

Colour = tuple[float, float, float]  # hue in degrees, saturation and value, 0 to 1
Vector2 = tuple[float, float]

PAPER_TILE_M = 0.32  # edge of a tile of printed paper
STRIPES_M = 0.2  # of a tile of the stripes on the landing box
_TILE_PX = 256
# A tile and its eight neighbours, in tile units.
_SHIFTS = np.array([[(dx, dy)] for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
# Rows of a carpet that are computed together: their floats fit into the processor's cache. Those of
# a whole carpet are 30 MB, whose pages take ten times as long as the computation.
_BAND_PX = 32
_SMOOTH = 4  # tiles are drawn larger by this factor and shrunk, which smooths the edges


def _rgb(colour: Colour) -> tuple[int, int, int]:
    hue_deg, saturation, value = colour
    r, g, b = colorsys.hsv_to_rgb(hue_deg / 360.0, saturation, value)
    return round(255 * r), round(255 * g), round(255 * b)


def to_bytes(image: NDArray[Any]) -> Image:
    """Return an image of numbers as one of bytes."""
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def clouds(
    rng: np.random.Generator, cells: tuple[int, int], size_px: tuple[int, int]
) -> NDArray[np.float32]:
    """Return smooth noise of that many rows and columns, as wide and high as asked, (H, W)."""
    coarse = rng.normal(0.0, 1.0, cells).astype(np.float32)
    return np.asarray(cv2.resize(coarse, size_px, interpolation=cv2.INTER_CUBIC))


def _filled(size_px: int, colour: tuple[int, int, int]) -> Image:
    """Return a square image of one colour. Copying a row is faster than copying three bytes."""
    image: Image = np.empty((size_px, size_px, 3), np.uint8)
    image[0] = colour
    image[1:] = image[0]
    return image


class _Tile:
    """A canvas that wraps around at its edges."""

    def __init__(self, ground: Colour, seed: int) -> None:
        self._size, self.seed = _TILE_PX * _SMOOTH, seed
        self._image = _filled(self._size, _rgb(ground))

    def polygon(self, points: NDArray[np.float64], colour: Colour) -> None:
        """Fill a polygon given in tile units (0 to 1), repeated beyond every edge."""
        for copy in ((points + _SHIFTS) * self._size).round().astype(np.int32):
            cv2.fillPoly(self._image, [copy], _rgb(colour))

    def done(self) -> Image:
        """Return the tile at its final size, with the grain of paper."""
        small = cv2.resize(self._image, (_TILE_PX, _TILE_PX), interpolation=cv2.INTER_AREA)
        noise = np.random.default_rng(self.seed).normal(0.0, 4.0, small.shape[:2])
        return to_bytes(small.astype(np.float32) + noise[..., None])


# --- what is printed on a tile --------------------------------------------------------------------

Layer = Callable[[_Tile], None]


@dataclass(frozen=True, kw_only=True)
class _Motif:
    """A polygon around a place: angles and radii of its corners, in tile units."""

    angles: NDArray[np.float64]
    radii: NDArray[np.float64] | float
    turned: bool = False  # each by another angle


def _disc(radius: float) -> _Motif:
    return _Motif(angles=np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), radii=radius)


def _star(outer: float, inner: float, points: int, *, turned: bool = False) -> _Motif:
    """Return a star; one of two points is a leaf."""
    number = np.arange(2 * points)
    radii = np.where(number % 2 == 0, outer, inner)
    return _Motif(angles=number * np.pi / points, radii=radii, turned=turned)


def _bricks(count: int, jitter: float, motif: _Motif, *colours: Colour) -> Layer:
    """Return jittered motifs in a brick pattern, coloured in turn."""

    def draw(tile: _Tile) -> None:
        rng = np.random.default_rng(tile.seed)
        for index in range(count**2):
            row, column = divmod(index, count)
            dx, dy = rng.uniform(-jitter, jitter, 2) / count
            x = (column + 0.5 * (row % 2) + 0.25) / count + dx
            y = (row + 0.5) / count + dy
            angles = motif.angles + rng.uniform(0.0, 2.0 * np.pi) * motif.turned
            points = np.column_stack(
                [x + motif.radii * np.cos(angles), y + motif.radii * np.sin(angles)]
            )
            tile.polygon(points, colours[index % len(colours)])

    return draw


def _zigzag(*colours: Colour) -> Layer:
    """Return horizontal zigzag bands of alternating colours."""

    def draw(tile: _Tile) -> None:
        x = np.linspace(-0.125, 1.125, 11)
        swing = 0.35 / 8 * np.where(np.arange(11) % 2 == 0, 1.0, -1.0)
        for band in range(-1, 9):
            y = np.concatenate([band / 8 + swing, ((band + 1) / 8 + swing)[::-1]])
            outline = np.column_stack([np.concatenate([x, x[::-1]]), y])
            tile.polygon(outline, colours[band % len(colours)])

    return draw


def _checks(*colours: Colour) -> Layer:
    """Return a chequerboard, its squares coloured in turn by fours."""

    def draw(tile: _Tile) -> None:
        square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        for row, column in np.ndindex(8, 8):
            if (row + column) % 2 == 0:
                colour = colours[(row // 2 + column // 2) % 2]
                tile.polygon((square + np.array((column, row))) / 8, colour)

    return draw


def _repeated(corners: list[Vector2], shifts: list[Vector2], colour: Colour) -> Layer:
    """Return a polygon at each shift."""

    def draw(tile: _Tile) -> None:
        for shift in shifts:
            tile.polygon(np.array(corners) + np.array(shift), colour)

    return draw


_LEAF: Final = _star(0.075, 0.022, 2, turned=True)
_STAR: Final = _star(0.068, 0.030, 5, turned=True)
_TRIANGLE: Final = _Motif(angles=np.array([0.0, 2.1, 4.2]), radii=0.06, turned=True)
_BAR: Final = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.05), (0.0, 0.05)]
_SLANTED: Final = [(0.0, 0.0), (0.25, 0.0), (1.25, 1.0), (1.0, 1.0)]

# The colour of each paper, and its print.
_PAPERS: Final[dict[str, tuple[Colour, *tuple[Layer, ...]]]] = {
    "dots": ((322, 0.80, 0.80), _bricks(6, 0.0, _disc(0.052), (320, 0.12, 0.98))),
    "leaves": ((128, 0.72, 0.62), _bricks(7, 0.15, _LEAF, (75, 0.55, 0.92), (140, 0.85, 0.30))),
    "waves": (
        (222, 0.85, 0.72),
        _zigzag((222, 0.85, 0.72), (205, 0.45, 0.96)),
        _bricks(5, 0.0, _disc(0.024), (230, 0.05, 0.97)),
    ),
    "zigzag": ((24, 0.70, 0.45), _zigzag((24, 0.72, 0.42), (33, 0.50, 0.85))),
    "stars": (
        (275, 0.62, 0.48),
        _bricks(6, 0.1, _STAR, (285, 0.30, 0.90), *[(55, 0.60, 0.95)] * 2),
    ),
    "triangles": (
        (176, 0.70, 0.75),
        _bricks(7, 0.05, _TRIANGLE, (180, 0.90, 0.38), (350, 0.60, 0.92)),
    ),
    "checks": ((220, 0.20, 0.12), _checks((92, 0.85, 0.85), (0, 0.0, 0.93))),
    "confetti": (
        (44, 0.34, 0.97),
        _bricks(7, 0.2, _disc(0.042), (214, 0.75, 0.70), (356, 0.80, 0.82)),
    ),
    "rings": (
        (345, 0.28, 0.96),
        _bricks(5, 0.0, _disc(0.082), (342, 0.85, 0.50)),
        _bricks(5, 0.0, _disc(0.050), (345, 0.28, 0.96)),
    ),
    "bars": (
        (62, 0.55, 0.55),
        _repeated(_BAR, [(0.0, index / 8) for index in range(8)], (70, 0.80, 0.24)),
    ),
    "crosses": (
        (258, 0.30, 0.90),
        _bricks(6, 0.0, _star(0.075, 0.022, 4), (250, 0.55, 0.60), (155, 0.65, 0.60)),
    ),
    "spots": ((15, 0.55, 0.26), _bricks(6, 0.1, _disc(0.050), (190, 0.60, 0.90))),
    "diamonds": ((210, 0.05, 0.72), _bricks(6, 0.0, _star(0.062, 0.044, 2), (20, 0.90, 0.94))),
    "stripes": ((50, 0.92, 0.96), _repeated(_SLANTED, [(0.0, 0.0), (0.5, 0.0)], (2, 0.90, 0.80))),
}
_SEEDS: Final[dict[str, int]] = {
    "stripes": 302,
    **{name: 101 + index for index, name in enumerate(SIDE_PAPERS)},
    **{name: 201 + index for index, name in enumerate(ROOF_PAPERS)},
}


@cache
def paper(name: str) -> Image:
    """Return the tile of a printed paper, (256, 256, 3), by the name of its generator."""
    ground, *layers = _PAPERS[name]
    tile = _Tile(ground, _SEEDS[name])
    for layer in layers:
        layer(tile)
    return tile.done()


@cache
def carpet(size_m: tuple[float, float]) -> Image:
    """Return a whole carpet, (H, W, 3), 256 pixels per metre along x (columns) and y.

    It has irregular motifs at every scale, so that each place looks different.
    """
    rng = np.random.default_rng(300)
    width, height = (round(256 * side) for side in size_m)
    weave: NDArray[np.float32] = np.zeros((height, width), np.float32)
    for cells_a_metre, weight in ((2, 0.5), (8, 0.9), (32, 0.7)):
        columns, rows = (round(cells_a_metre * side) for side in size_m)
        weave += weight * clouds(rng, (rows, columns), (width, height))
    light = np.array(_rgb((192, 0.24, 0.68)), np.float32)
    dark = np.array(_rgb((200, 0.42, 0.36)), np.float32)
    share = (1.0 / (1.0 + np.exp(-2.2 * weave)))[..., None]
    image: Image = np.empty((height, width, 3), np.uint8)
    bands = [slice(first, first + _BAND_PX) for first in range(0, height, _BAND_PX)]
    for band in bands:
        image[band] = dark + share[band] * (light - dark)
    for _ in range(round(45 * size_m[0] * size_m[1])):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        size = int(rng.integers(5, 13))
        colour = _rgb((38, 0.30, 0.78)) if rng.random() < 0.5 else _rgb((205, 0.55, 0.25))
        corners = rng.uniform(0.0, 2.0 * np.pi) + np.arange(4) * np.pi / 2
        points = np.column_stack([x + size * np.cos(corners), y + size * np.sin(corners)])
        cv2.fillPoly(image, [points.round().astype(np.int32)], colour, cv2.LINE_AA)
    grain = rng.normal(0.0, 5.0, (height, width, 1))
    for band in bands:
        image[band] = to_bytes(image[band].astype(np.float32) + grain[band])
    return image


@cache
def helipad_top() -> Image:
    """Return the H panel, (512, 512, 3); the top of the letter is the top of the image."""
    size = 512 * _SMOOTH
    image = _filled(size, _rgb((150, 0.80, 0.28)))
    white = _rgb((150, 0.03, 0.96))
    centre = (size // 2, size // 2)
    cv2.circle(image, centre, round(0.44 * size), white, round(0.055 * size), cv2.LINE_AA)
    for x0, x1, y0, y1 in (
        (0.30, 0.40, 0.24, 0.76),
        (0.60, 0.70, 0.24, 0.76),
        (0.4, 0.6, 0.45, 0.55),
    ):
        image[round(y0 * size) : round(y1 * size), round(x0 * size) : round(x1 * size)] = white
    small = cv2.resize(image, (512, 512), interpolation=cv2.INTER_AREA).astype(np.float32)
    grain = np.random.default_rng(301).normal(0.0, 3.0, (512, 512, 1))
    return to_bytes(small + grain)


@cache
def plain(value: float, seed: int) -> Image:
    """Return a nearly featureless surface, (256, 256, 3): grey (0 to 1) with smooth shading."""
    rng = np.random.default_rng(seed)
    shade = clouds(rng, (4, 4), (256, 256))
    grain = rng.normal(0.0, 0.6, (256, 256))
    grey = 255.0 * value * (1.0 + 0.025 * shade) + grain
    return to_bytes(np.stack([grey * 1.004, grey, grey * 0.985], axis=-1))
