"""Images and cameras turned by the orientation in a file."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from perception.camera.image_files import UPRIGHT, Orientation, exif_orientation, read_image
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel

RAW_LENS = {"fx_px": 50.0, "fy_px": 52.0, "cx_px": 30.0, "cy_px": 20.0}
DISTORTION = (-0.1, 0.05, 0.01, -0.02, 0.003)
RAW = CameraModel(width_px=64, height_px=36, **RAW_LENS, distortion=DISTORTION)
# (1, 2) in the upper left of the shown image, whatever the orientation:
SHOWN = np.array([[1, 2, 3], [4, 5, 6]], dtype=np.uint8)
STORED = {
    "upright": ([[1, 0], [0, 1]], [[1, 2, 3], [4, 5, 6]]),
    "half a turn": ([[-1, 0], [0, -1]], [[6, 5, 4], [3, 2, 1]]),
    "quarter clockwise": ([[0, 1], [-1, 0]], [[3, 6], [2, 5], [1, 4]]),
    "quarter counterclockwise": ([[0, -1], [1, 0]], [[4, 1], [5, 2], [6, 3]]),
    "mirrored": ([[-1, 0], [0, 1]], [[3, 2, 1], [6, 5, 4]]),
}


@pytest.mark.parametrize("name", STORED)
def test_a_stored_image_and_its_camera_are_turned_as_players_show_it(name: str) -> None:
    """A raw pixel that is marked alone is shown where the turned camera projects its point."""
    ((a, b), (c, d)), rows = STORED[name]
    turn = Orientation.from_display_matrix(65536.0 * np.array([[a, b], [c, d]]))
    stored = np.repeat(np.array(rows, np.uint8)[..., None], 3, axis=2)
    assert turn.image(stored)[..., 0].tolist() == SHOWN.tolist()
    assert turn.upright == (name == "upright")
    point = np.array([[0.2, -0.15, 1.0]])
    shown_point = point @ np.array([[a, b, 0], [c, d, 0], [0, 0, 1.0]])

    def pixel(camera: CameraModel, seen: np.ndarray) -> np.ndarray:
        still, distortion = np.zeros(3), np.array(camera.distortion)
        return cv2.projectPoints(seen, still, still, camera.matrix, distortion)[0].reshape(2)

    column, row = pixel(RAW, point)
    camera = turn.camera(RAW)
    marked = np.zeros((36, 64, 3), np.uint8)
    marked[round(row), round(column)] = 255
    shown = turn.image(marked)
    assert shown.shape[:2] == (camera.height_px, camera.width_px)
    (shown_row, shown_column) = np.argwhere(shown[..., 0])[0]
    assert pixel(camera, shown_point) == pytest.approx((shown_column, shown_row), abs=0.51)
    off_raw = np.array([column - round(column), row - round(row)])
    off_shown = pixel(camera, shown_point) - (shown_column, shown_row)
    assert off_shown == pytest.approx(off_raw @ np.array([[a, b], [c, d]]), abs=1e-6)


def test_between_the_quarters_and_a_lens_of_more_numbers_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="must be a multiple of 90 degrees"):
        Orientation.from_display_matrix(np.array([[0.7, 0.7], [-0.7, 0.7]]))
    wide = replace(RAW, distortion=(0.0,) * 8)
    assert UPRIGHT.camera(wide) is wide
    with pytest.raises(ValueRangeError, match="five distortion numbers or fewer, got 8"):
        Orientation.from_display_matrix(-np.eye(2)).camera(wide)


@pytest.mark.parametrize("value", range(1, 9))
def test_the_orientation_of_a_photograph_is_that_of_viewers(tmp_path: Path, value: int) -> None:
    """All eight values of the EXIF tag, on an image whose four quarters differ."""
    stored = np.kron(np.array([[20, 90], [160, 230]], np.uint8), np.ones((16, 32), np.uint8))
    exif = Image.Exif()
    exif[0x0112] = value
    path = tmp_path / "photograph.jpg"
    Image.fromarray(stored).convert("RGB").save(path, quality=98, exif=exif)
    raw = read_image(path, colour=True, as_stored=True)
    shown = read_image(path, colour=True, as_stored=False)
    assert raw.shape == (32, 64, 3)
    assert shown.shape == ((32, 64, 3) if value < 5 else (64, 32, 3))
    assert np.abs(exif_orientation(path).image(raw).astype(int) - shown).max() <= 2


def test_a_photograph_without_an_orientation_is_upright(tmp_path: Path) -> None:
    for name in ("plain.jpg", "plain.png"):
        Image.new("RGB", (8, 4)).save(tmp_path / name)
        assert exif_orientation(tmp_path / name) == UPRIGHT
    (tmp_path / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe1\0\x10Exif\0\0II*\0\xff\xff\xff\xff")
    assert exif_orientation(tmp_path / "cut.jpg") == UPRIGHT
