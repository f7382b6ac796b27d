"""Textures of the boxes, the carpet and the pad, generated from fixed seeds.

Each pattern is a square tile of known size in metres that repeats seamlessly. A pattern has two or
three hues, mixed so finely that a window of a few centimetres contains all of them. Colour
histograms then distinguish the patterns, as they do for printed wrapping paper.
"""

from __future__ import annotations

import colorsys
from collections.abc import Iterator
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Image

Place = tuple[float, float, float]  # x and y in tile units, rotation in radians

TILE_M = 0.32  # edge of a tile of a side or roof
_TILE_PX = 256
# A tile and its eight neighbours, in tile units.
_SHIFTS = np.array([[(dx, dy)] for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
_BAND_PX = 32  # rows that are computed together; chosen
_SMOOTH = 4  # tiles are drawn larger by this factor and shrunk, which smooths the edges


def _rgb(hue_deg: float, saturation: float, value: float) -> tuple[int, int, int]:
    r, g, b = colorsys.hsv_to_rgb(hue_deg / 360.0, saturation, value)
    return round(255 * r), round(255 * g), round(255 * b)


def _to_bytes(image: NDArray[Any]) -> Image:
    result: Image = np.clip(image, 0, 255).astype(np.uint8)
    return result


def _bands(height_px: int) -> Iterator[slice]:
    """Yield the rows of an image, some at a time.

    The floats of some rows fit into the processor's cache. Those of a whole carpet are 30 MB, whose
    pages take ten times as long as the computation.
    """
    for first in range(0, height_px, _BAND_PX):
        yield slice(first, first + _BAND_PX)


def _filled(size_px: int, colour: tuple[int, int, int]) -> Image:
    """Return a square image of one colour. Copying a row is faster than copying three bytes."""
    image: Image = np.empty((size_px, size_px, 3), np.uint8)
    image[0] = colour
    image[1:] = image[0]
    return image


def _touch(polygons: NDArray[np.int32], size_px: int) -> NDArray[np.bool_]:
    """Return which polygons, (N, points, 2), may have pixels in a square image."""
    least, most = polygons.min(axis=1), polygons.max(axis=1)
    return np.asarray(((most >= 0) & (least < size_px)).all(axis=1))


class _Tile:
    """A canvas that wraps around at its edges."""

    def __init__(self, ground: tuple[int, int, int], size_px: int = _TILE_PX) -> None:
        self.size = size_px * _SMOOTH
        self._out_px = size_px
        self.image = _filled(self.size, ground)

    def polygon(self, points: NDArray[np.float64], colour: tuple[int, int, int]) -> None:
        """Fill a polygon given in tile units (0 to 1), repeated beyond every edge."""
        copies = ((points + _SHIFTS) * self.size).round().astype(np.int32)
        for copy in copies[_touch(copies, self.size)]:
            cv2.fillPoly(self.image, [copy], colour)

    def disc(self, x: float, y: float, radius: float, colour: tuple[int, int, int]) -> None:
        """Fill a disc given in tile units."""
        turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
        self.polygon(
            np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)]), colour
        )

    def star(
        self, place: Place, shape: tuple[float, float, int], colour: tuple[int, int, int]
    ) -> None:
        """Fill a star of a shape (outer radius, inner radius, points); two points make a leaf."""
        (x, y, turn), (outer, inner, points) = place, shape
        angle = turn + np.arange(2 * points) * np.pi / points
        radius = np.where(np.arange(2 * points) % 2 == 0, outer, inner)
        self.polygon(
            np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)]), colour
        )

    def done(self, seed: int, grain: float = 4.0) -> Image:
        """Return the tile at its final size, with the grain of paper."""
        small = cv2.resize(
            self.image, (self._out_px, self._out_px), interpolation=cv2.INTER_AREA
        ).astype(np.float32)
        noise = np.random.default_rng(seed).normal(0.0, grain, small.shape[:2])
        return _to_bytes(small + noise[..., None])


def _grid(count: int, seed: int, jitter: float) -> list[Place]:
    """Return jittered places in a brick pattern, each with a random rotation."""
    rng = np.random.default_rng(seed)
    places = []
    for row in range(count):
        for column in range(count):
            dx, dy = rng.uniform(-jitter, jitter, 2) / count
            x = (column + 0.5 * (row % 2) + 0.25) / count + dx
            places.append((x, (row + 0.5) / count + dy, rng.uniform(0.0, 2.0 * np.pi)))
    return places


def _zigzag(tile: _Tile, bands: int, colours: list[tuple[int, int, int]]) -> None:
    """Cover a tile with horizontal zigzag bands of alternating colours."""
    x = np.linspace(-0.125, 1.125, 11)
    swing = 0.35 / bands * np.where(np.arange(11) % 2 == 0, 1.0, -1.0)
    for band in range(-1, bands + 1):
        top, bottom = band / bands + swing, (band + 1) / bands + swing
        outline = np.column_stack(
            [np.concatenate([x, x[::-1]]), np.concatenate([top, bottom[::-1]])]
        )
        tile.polygon(outline, colours[band % len(colours)])


@cache
def side(pattern: int) -> Image:
    """Return the tile of the sides of box ``pattern`` (1 to 8), (256, 256, 3), 0.32 m square."""
    return (
        _magenta_dots,
        _green_leaves,
        _blue_waves,
        _brown_zigzag,
        _purple_stars,
        _turquoise_triangles,
        _black_checks,
        _cream_confetti,
    )[pattern - 1](100 + pattern)


def _magenta_dots(seed: int) -> Image:
    tile = _Tile(_rgb(322, 0.80, 0.80))
    for x, y, _ in _grid(6, seed, 0.0):
        tile.disc(x, y, 0.052, _rgb(320, 0.12, 0.98))
    return tile.done(seed)


def _green_leaves(seed: int) -> Image:
    tile = _Tile(_rgb(128, 0.72, 0.62))
    for index, place in enumerate(_grid(7, seed, 0.15)):
        light = index % 2 == 0
        colour = _rgb(75, 0.55, 0.92) if light else _rgb(140, 0.85, 0.30)
        tile.star(place, (0.075, 0.022, 2), colour)
    return tile.done(seed)


def _blue_waves(seed: int) -> Image:
    tile = _Tile(_rgb(222, 0.85, 0.72))
    _zigzag(tile, 8, [_rgb(222, 0.85, 0.72), _rgb(205, 0.45, 0.96)])
    for x, y, _ in _grid(5, seed, 0.0):
        tile.disc(x, y, 0.024, _rgb(230, 0.05, 0.97))
    return tile.done(seed)


def _brown_zigzag(seed: int) -> Image:
    tile = _Tile(_rgb(24, 0.70, 0.45))
    _zigzag(tile, 8, [_rgb(24, 0.72, 0.42), _rgb(33, 0.50, 0.85)])
    return tile.done(seed)


def _purple_stars(seed: int) -> Image:
    tile = _Tile(_rgb(275, 0.62, 0.48))
    for index, place in enumerate(_grid(6, seed, 0.1)):
        colour = _rgb(55, 0.60, 0.95) if index % 3 else _rgb(285, 0.30, 0.90)
        tile.star(place, (0.068, 0.030, 5), colour)
    return tile.done(seed)


def _turquoise_triangles(seed: int) -> Image:
    tile = _Tile(_rgb(176, 0.70, 0.75))
    for index, (x, y, turn) in enumerate(_grid(7, seed, 0.05)):
        corners = turn + np.array([0.0, 2.1, 4.2])
        points = np.column_stack([x + 0.06 * np.cos(corners), y + 0.06 * np.sin(corners)])
        tile.polygon(points, _rgb(350, 0.60, 0.92) if index % 2 else _rgb(180, 0.90, 0.38))
    return tile.done(seed)


def _black_checks(seed: int) -> Image:
    tile = _Tile(_rgb(220, 0.20, 0.12))
    step = 1.0 / 8
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * step
    for row in range(8):
        for column in range(8):
            if (row + column) % 2 == 0:
                lime = (row // 2 + column // 2) % 2 == 0
                colour = _rgb(92, 0.85, 0.85) if lime else _rgb(0, 0.0, 0.93)
                tile.polygon(corner + np.array((column, row)) * step, colour)
    return tile.done(seed)


def _cream_confetti(seed: int) -> Image:
    tile = _Tile(_rgb(44, 0.34, 0.97))
    for index, (x, y, _) in enumerate(_grid(7, seed, 0.2)):
        colour = _rgb(356, 0.80, 0.82) if index % 2 else _rgb(214, 0.75, 0.70)
        tile.disc(x, y, 0.042, colour)
    return tile.done(seed)


@cache
def roof(pattern: int) -> Image:
    """Return the tile of roof ``pattern`` (1 to 5), (256, 256, 3), 0.32 m square."""
    return (_rose_rings, _olive_bars, _lavender_crosses, _cocoa_dots, _silver_diamonds)[
        pattern - 1
    ](200 + pattern)


def _rose_rings(seed: int) -> Image:
    tile = _Tile(_rgb(345, 0.28, 0.96))
    for x, y, _ in _grid(5, seed, 0.0):
        tile.disc(x, y, 0.082, _rgb(342, 0.85, 0.50))
        tile.disc(x, y, 0.050, _rgb(345, 0.28, 0.96))
    return tile.done(seed)


def _olive_bars(seed: int) -> Image:
    tile = _Tile(_rgb(62, 0.55, 0.55))
    bar = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.05], [0.0, 0.05]])
    for index in range(8):
        tile.polygon(bar + np.array((0.0, index / 8)), _rgb(70, 0.80, 0.24))
    return tile.done(seed)


def _lavender_crosses(seed: int) -> Image:
    tile = _Tile(_rgb(258, 0.30, 0.90))
    for index, (x, y, _) in enumerate(_grid(6, seed, 0.0)):
        colour = _rgb(155, 0.65, 0.60) if index % 2 else _rgb(250, 0.55, 0.60)
        tile.star((x, y, 0.0), (0.075, 0.022, 4), colour)
    return tile.done(seed)


def _cocoa_dots(seed: int) -> Image:
    tile = _Tile(_rgb(15, 0.55, 0.26))
    for x, y, _ in _grid(6, seed, 0.1):
        tile.disc(x, y, 0.050, _rgb(190, 0.60, 0.90))
    return tile.done(seed)


def _silver_diamonds(seed: int) -> Image:
    tile = _Tile(_rgb(210, 0.05, 0.72))
    for x, y, _ in _grid(6, seed, 0.0):
        tile.star((x, y, 0.0), (0.062, 0.044, 2), _rgb(20, 0.90, 0.94))
    return tile.done(seed)


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
        coarse = rng.normal(0.0, 1.0, (rows, columns)).astype(np.float32)
        weave += weight * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    light = np.array(_rgb(192, 0.24, 0.68), np.float32)
    dark = np.array(_rgb(200, 0.42, 0.36), np.float32)
    share = (1.0 / (1.0 + np.exp(-2.2 * weave)))[..., None]
    image: Image = np.empty((height, width, 3), np.uint8)
    for band in _bands(height):
        image[band] = dark + share[band] * (light - dark)
    for _ in range(round(45 * size_m[0] * size_m[1])):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        size = int(rng.integers(5, 13))
        colour = _rgb(38, 0.30, 0.78) if rng.random() < 0.5 else _rgb(205, 0.55, 0.25)
        corners = rng.uniform(0.0, 2.0 * np.pi) + np.arange(4) * np.pi / 2
        points = np.column_stack([x + size * np.cos(corners), y + size * np.sin(corners)])
        cv2.fillPoly(image, [points.round().astype(np.int32)], colour, cv2.LINE_AA)
    grain = rng.normal(0.0, 5.0, (height, width, 1))
    for band in _bands(height):
        image[band] = _to_bytes(image[band].astype(np.float32) + grain[band])
    return image


@cache
def helipad_top() -> Image:
    """Return the H panel, (512, 512, 3); the top of the letter is the top of the image."""
    size = 512 * _SMOOTH
    image = _filled(size, _rgb(150, 0.80, 0.28))
    white = _rgb(150, 0.03, 0.96)
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
    return _to_bytes(small + grain)


@cache
def stripes() -> Image:
    """Return the tile of yellow and red slanted stripes, (256, 256, 3), 0.2 m square."""
    tile = _Tile(_rgb(50, 0.92, 0.96))
    band = np.array([[0.0, 0.0], [0.25, 0.0], [1.25, 1.0], [1.0, 1.0]])
    for shift in (0.0, 0.5):
        tile.polygon(band + np.array((shift, 0.0)), _rgb(2, 0.90, 0.80))
    return tile.done(302)


@cache
def plain(value: float, seed: int) -> Image:
    """Return a nearly featureless surface, (256, 256, 3): grey with smooth shading.

    Args:
        value: brightness, 0 to 1.
        seed: random seed of the shading.
    """
    rng = np.random.default_rng(seed)
    shade = cv2.resize(rng.normal(0.0, 1.0, (4, 4)), (256, 256), interpolation=cv2.INTER_CUBIC)
    grain = rng.normal(0.0, 0.6, (256, 256))
    grey = 255.0 * value * (1.0 + 0.025 * shade) + grain
    return _to_bytes(np.stack([grey * 1.004, grey, grey * 0.985], axis=-1))
