"""Textures: reproducible, seamless, distinguishable by colour, with lines where a lab has them."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.twin import textures
from sim_bridge.twin.surfaces import paint_of
from uav_bt.errors import FileError
from uav_bt.lab.surface import ROOF_PAPERS, SIDE_PAPERS, PaintedLine, Surface

RED = PaintedLine(points_m=((0.5, 0.25), (0.9, 0.25)), width_m=0.2, colour="#ff0000")
WHOLE_M = (2.0, 1.0)


def histogram(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the shares of hues and saturations in an image."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    return cv2.calcHist([hsv], [0, 1], None, [18, 5], [0, 180, 0, 256]) / hsv[..., 0].size


def test_all_looks_differ_in_colour() -> None:
    """Two textures share at most half of their hue and saturation, without shading."""
    images = [textures.paper(name) for name in (*SIDE_PAPERS, *ROOF_PAPERS, "stripes")]
    images += [textures.carpet((5.0, 4.0)), textures.helipad_top(), textures.plain(0.8, 1)]
    for a, b in itertools.combinations(map(histogram, images), 2):
        assert np.minimum(a, b).sum() < 0.5


@pytest.mark.parametrize("name", [*SIDE_PAPERS, *ROOF_PAPERS, "concrete", "wood"])
def test_tiles_repeat_without_a_seam(name: str) -> None:
    """Neighbouring pixels differ across the edge as little as inside."""
    image = paint_of(Surface(generator=name), Path()).make().astype(float)
    for axis in (1,) if name in {"concrete", "wood"} else (0, 1):
        rows = np.moveaxis(image, axis, 0)
        inside = np.abs(np.diff(rows, axis=0)).mean(axis=(1, 2))
        assert np.abs(rows[0] - rows[-1]).mean() <= inside.max() + 6.0


@pytest.mark.parametrize(
    "given",
    [
        {"colour": "#808080"},
        {"generator": "concrete"},
        {"generator": "carpet"},
        {"image": "grey.png"},
        {"image": "grey.png", "tile_m": (0.3, 0.3)},
    ],
)
def test_a_line_is_painted_at_its_place(tmp_path: Path, given: dict[str, Any]) -> None:
    """The first row of the texture is the largest y, the last column the largest x."""
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((64, 64, 3), 128, np.uint8))
    paint = paint_of(Surface(**given, lines=(RED,)), tmp_path, WHOLE_M)
    image = paint.make().astype(int)
    assert paint.tile_m == WHOLE_M
    assert np.array_equal(image, paint.make())
    height, width = image.shape[:2]
    assert width == pytest.approx(2 * height, abs=2)
    rows, columns = np.nonzero((image[..., 0] > 170) & (image[..., 1] < 90))
    assert (columns.mean() + 0.5) / width * 2.0 - 1.0 == pytest.approx(0.7, abs=0.02)
    assert 0.5 - (rows.mean() + 0.5) / height == pytest.approx(0.25, abs=0.02)
    assert (rows.max() - rows.min() + 1) / height == pytest.approx(0.2, abs=0.03)


def test_a_colour_is_the_mean_of_its_texture() -> None:
    """Alone it is plain on walls and furniture; on the ground it is a carpet of this colour."""
    alone, painted = Surface(colour="#2c5aa8"), Surface(generator="paint", colour="#2c5aa8")
    wall, ground = paint_of(alone, Path()), paint_of(alone, Path(), WHOLE_M)
    paint = paint_of(painted, Path())
    for image in (wall.make(), ground.make(), paint.make()):
        assert image.mean(axis=(0, 1)) == pytest.approx((0x2C, 0x5A, 0xA8), abs=8)
    assert [wall.make().std(axis=(0, 1)).max(), ground.tile_m] == [0.0, WHOLE_M]
    assert ground.make()[..., 2].std() > 8.0, "odometry needs texture"
    assert len({each.name for each in (wall, ground, paint)}) == 3


def test_a_picture_that_is_cut_off_is_refused_when_it_is_drawn(hall: Path) -> None:
    picture = hall / "wood.png"
    picture.write_bytes(picture.read_bytes()[:40])
    with pytest.raises(FileError, match=r"wood.png: is a damaged picture"):
        paint_of(Surface(image="wood.png"), hall).make()
