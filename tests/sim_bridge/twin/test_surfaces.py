"""Textures of a lab's surfaces: sizes, seams, and painted lines where the file has them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from sim_bridge.twin.surfaces import paint_of
from uav_bt.lab.room import PaintedLine, Surface

RED = PaintedLine(points_m=((0.5, 0.25), (0.9, 0.25)), width_m=0.2, colour="#ff0000")
WHOLE_M = (2.0, 1.0)


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
    height, width = image.shape[:2]
    assert width == pytest.approx(2 * height, abs=2)
    red = (image[..., 0] > 170) & (image[..., 1] < 90)
    rows, columns = np.nonzero(red)
    assert (columns.mean() + 0.5) / width * 2.0 - 1.0 == pytest.approx(0.7, abs=0.02)
    assert 0.5 - (rows.mean() + 0.5) / height == pytest.approx(0.25, abs=0.02)
    assert (rows.max() - rows.min() + 1) / height == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("generator", ["concrete", "wood"])
def test_repeated_textures_have_no_seam_from_left_to_right(generator: str) -> None:
    surface = Surface(generator=generator)
    image = paint_of(surface, Path()).make().astype(float)
    within = np.abs(np.diff(image, axis=1)).mean()
    assert np.abs(image[:, 0] - image[:, -1]).mean() < 1.5 * within


def test_textures_are_the_same_each_time() -> None:
    surface = Surface(generator="concrete", colour="#8f908c", lines=(RED,))
    first, second = (paint_of(surface, Path(), WHOLE_M).make() for _ in range(2))
    assert np.array_equal(first, second)


def test_a_colour_is_the_mean_of_its_texture() -> None:
    image = paint_of(Surface(colour="#2c5aa8"), Path()).make()
    assert image.mean(axis=(0, 1)) == pytest.approx((0x2C, 0x5A, 0xA8), abs=8)
