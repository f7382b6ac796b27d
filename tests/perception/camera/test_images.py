"""Images from files, and images that repeat or are dark."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from perception.camera.frame_watch import FrameWatch
from perception.camera.image_files import UPRIGHT, Orientation, exif_orientation, read_image
from tests.worlds import values
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, BodyVelocity, CameraModel, DroneState, FlyingState, Frame

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


# --- frames that arrive in time and show nothing --------------------------------------------------

FROZEN = "the video is frozen"
STATE = DroneState(captured_s=0.0, flying=FlyingState.HOVERING)
TILES = np.random.default_rng(1).integers(40, 200, (9, 16, 3), dtype=np.uint8)
SCENE = cv2.resize(TILES, (160, 90), interpolation=cv2.INTER_CUBIC)


def frame(
    image: NDArray[np.uint8], index: int, pitch_rad: float = 0.0, yaw_rad: float = 0.0
) -> Frame:
    more = {"captured_s": index * 0.1, "index": index, "attitude": Attitude(yaw_rad=yaw_rad)}
    return values.frame(image, pitch_rad, **more)


def noisy(index: int, sigma: float = 4.0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(index).normal(0.0, sigma, SCENE.shape)
    return np.clip(SCENE + noise, 0, 255).astype(np.uint8)


def test_an_image_that_shows_nothing_is_named() -> None:
    for image, why in (
        (np.zeros_like(SCENE), "dark"),
        (np.full_like(SCENE, 255), "overexposed"),
        (np.full_like(SCENE, 90), "lens covered"),
        (noisy(1, sigma=80.0), "all noise"),
        (cv2.GaussianBlur(SCENE, (0, 0), 9) // 12, "dark"),
    ):
        assert why in (FrameWatch()(frame(image, 0), STATE) or "")
    corner = np.full_like(SCENE, 8)  # most of an image may be a black floor: the mean tells little
    corner[:45, :50] = 60
    assert FrameWatch()(frame(corner, 0), STATE) is None


def test_a_noisy_camera_does_not_show_the_same_image_twice() -> None:
    watch = FrameWatch()
    for index in range(10):
        assert watch(frame(noisy(index), index), STATE) is None
    reasons = {watch(frame(noisy(9), index), STATE) for index in range(10, 20)}
    assert reasons == {FROZEN}
    assert watch(frame(noisy(20), 20), STATE) is None  # it goes on


@pytest.mark.parametrize("rates", [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0, 0, 0.3)])
def test_an_image_must_change_when_the_camera_moves(rates: tuple[float, float, float]) -> None:
    """An image without noise may stay the same while the drone hovers, and no longer."""
    yaw_radps, pitch_radps, speed_mps = rates
    moving = replace(STATE, velocity=BodyVelocity(forward_mps=speed_mps))
    watch, said = FrameWatch(), None
    for index in range(20):
        turned = (pitch_radps * index * 0.1, yaw_radps * index * 0.1)
        said = watch(frame(SCENE, index, *turned), moving)
    assert said == (FROZEN if any(rates) else None)
