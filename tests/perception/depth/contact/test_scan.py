"""The panorama of a class map, the runs in its columns, and the sides above bases."""

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView
from perception.depth.contact.scan import NOT_IN_IMAGE, Panorama
from tests.paper_lab import CARPET, CLASS_COUNT
from uav_bt.testing import pinhole
from uav_bt.types.projection import project

CAMERA = pinhole(64, 36)
BOX = 5


@pytest.mark.parametrize(("pitch_rad", "roll_rad"), [(-0.4, 0.0), (-0.6, 0.05), (-1.5, 0.0)])
def test_a_cell_has_the_class_of_the_nearest_pixel(pitch_rad: float, roll_rad: float) -> None:
    ids = np.random.default_rng(0).integers(0, CLASS_COUNT, (36, 64), dtype=np.uint8)
    view = CameraView(camera=CAMERA, pitch_rad=pitch_rad, height_m=1.5, roll_rad=roll_rad)
    panorama = Panorama.of(ids, view)
    azimuth, depression = np.meshgrid(panorama.azimuth_rad, panorama.depression_rad)
    level = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(depression)], axis=-1)
    with np.errstate(invalid="ignore"):
        exact = project(level, CAMERA, pitch_rad, roll_rad)
        inside = ((exact > -0.5) & (exact < (63.5, 35.5))).all(axis=-1)
        # Between two pixels rounding decides.
        clear = (np.abs(exact % 1.0 - 0.5) > 1e-3).all(axis=-1)
    columns, rows = np.rint(exact[inside & clear]).astype(int).T
    assert np.array_equal(panorama.ids[inside & clear], ids[rows, columns])
    assert (panorama.ids[~inside & (clear | np.isnan(exact).any(axis=-1))] == NOT_IN_IMAGE).all()


def panorama_of(*columns: str) -> Panorama:
    """Return a panorama of columns, each from low to high: c carpet, b box, o other, - outside."""
    table = {"c": CARPET, "b": BOX, "o": 0, "-": NOT_IN_IMAGE}
    ids = np.array([[table[cell] for cell in row] for row in zip(*columns, strict=True)], np.uint8)
    azimuth_rad, depression_rad = np.zeros(len(columns)), np.linspace(0.9, 0.1, len(ids))
    return Panorama(ids=ids, azimuth_rad=azimuth_rad, depression_rad=depression_rad, pixel_rad=0.1)


def test_the_lowest_long_run_of_a_class_counts() -> None:
    """Two pixels at least, and a pixel has two rows."""
    panorama = panorama_of("-cbbbobbbb", "bbbbcccccc", "ccccbbbccb", "----------")
    first, last = panorama.runs(CLASS_COUNT)
    assert first[BOX].tolist() == [6, 0, -1, -1]
    assert last[BOX].tolist() == [9, 3, 9, -1]
    assert first[CARPET].tolist() == [-1, 4, 0, -1]


def test_a_class_follows_within_a_gap_and_the_panorama() -> None:
    """Two pixels of another class at most."""
    panorama = panorama_of("cobbbbbb", "coooobbb", "cooooobb", "bbbbbbbb")
    rows, columns = np.array([2, 5, 6, 0]), np.arange(4)
    below = panorama.next_row(rows, columns, CARPET, -1)
    assert below.tolist() == [0, 0, -1, -1]
    assert panorama.next_row(below, columns, BOX, 1).tolist()[:2] == [2, 5]
