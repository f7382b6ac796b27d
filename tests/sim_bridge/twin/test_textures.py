"""Textures: reproducible, seamless, distinguishable by colour, with lines where a lab has them."""

from __future__ import annotations

import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.twin import textures
from sim_bridge.twin.surfaces import paint_of
from uav_bt.lab.room import ROOF_PAPERS, SIDE_PAPERS, PaintedLine, Surface

RED = PaintedLine(points_m=((0.5, 0.25), (0.9, 0.25)), width_m=0.2, colour="#ff0000")
WHOLE_M = (2.0, 1.0)
PAPERS = (*SIDE_PAPERS, *ROOF_PAPERS, "stripes")


def histogram(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the hue-saturation histogram of an image."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    bins = np.histogram2d(
        hsv[..., 0].ravel(), hsv[..., 1].ravel(), bins=(18, 5), range=((0, 180), (0, 256))
    )[0]
    return np.asarray(bins / bins.sum())


def test_all_seventeen_looks_differ_in_colour() -> None:
    """Two textures share at most half of their hue and saturation, without shading."""
    images = {name: textures.paper(name) for name in PAPERS}
    images |= {"carpet": textures.carpet((5.0, 4.0)), "h": textures.helipad_top()}
    images["wall"] = textures.plain(0.8, 1)
    shares = {name: histogram(image) for name, image in images.items()}
    for (a, x), (b, y) in itertools.combinations(shares.items(), 2):
        assert np.minimum(x, y).sum() < 0.5, (a, b)


@pytest.mark.parametrize("name", SIDE_PAPERS)
def test_a_small_window_shows_a_pattern_s_colours(name: str) -> None:
    """Each window of 10 cm has the colours of the whole sheet."""
    sheet, window = textures.paper(name), round(0.10 / textures.PAPER_TILE_M * 256)
    for corner in (0, 60, 120):
        piece = sheet[corner : corner + window, corner : corner + window]
        assert np.minimum(histogram(piece), histogram(sheet)).sum() > 0.6


@pytest.mark.parametrize(
    ("image", "axes"),
    [
        *((textures.paper(name), (0, 1)) for name in PAPERS),
        *(
            (paint_of(Surface(generator=name), Path()).make(), (1,))
            for name in ("concrete", "wood")
        ),
    ],
)
def test_tiles_repeat_without_a_seam(image: NDArray[np.uint8], axes: tuple[int, ...]) -> None:
    """Neighbouring pixels differ across the edge as little as inside."""
    for axis in axes:
        rows = np.moveaxis(image.astype(np.float64), axis, 0)
        inside = np.abs(np.diff(rows, axis=0)).mean(axis=(1, 2))
        assert np.abs(rows[0] - rows[-1]).mean() <= inside.max() + 6.0


@pytest.mark.parametrize(
    "surface",
    [
        Surface(colour="#808080", lines=(RED,)),
        Surface(generator="concrete", lines=(RED,)),
        Surface(generator="carpet", lines=(RED,)),
        Surface(image="grey.png", lines=(RED,)),
        Surface(image="grey.png", tile_m=(0.3, 0.3), lines=(RED,)),
    ],
    ids=["colour", "concrete", "carpet", "stretched picture", "repeated picture"],
)
def test_a_line_is_painted_at_its_place_on_the_ground(tmp_path: Path, surface: Surface) -> None:
    """The first row of the texture is the largest y, the last column the largest x."""
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((64, 64, 3), 128, np.uint8))
    paint = paint_of(surface, tmp_path, WHOLE_M)
    image = paint.make().astype(int)
    assert paint.tile_m == WHOLE_M
    assert np.array_equal(image, paint_of(surface, tmp_path, WHOLE_M).make())
    height, width = image.shape[:2]
    assert width == pytest.approx(2 * height, abs=2)
    red = (image[..., 0] > 170) & (image[..., 1] < 90)
    rows, columns = np.nonzero(red)
    assert (columns.mean() + 0.5) / width * 2.0 - 1.0 == pytest.approx(0.7, abs=0.02)
    assert 0.5 - (rows.mean() + 0.5) / height == pytest.approx(0.25, abs=0.02)
    assert (rows.max() - rows.min() + 1) / height == pytest.approx(0.2, abs=0.03)


def test_a_colour_is_the_mean_of_its_texture() -> None:
    image = paint_of(Surface(colour="#2c5aa8"), Path()).make()
    assert image.mean(axis=(0, 1)) == pytest.approx((0x2C, 0x5A, 0xA8), abs=8)
