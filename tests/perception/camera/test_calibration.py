"""Calibration on drawn photographs of a board, whose camera is known exactly."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from perception.camera import calibration as module
from perception.camera.calibration import LayoutTrial, calibrate, doubts, fault
from perception.camera.camera_file import Undistorter
from perception.camera.checkerboards import find_any_board, find_board, find_boards
from sim_bridge.anafi import anafi_camera
from tests.worlds.tables import cases
from uav_bt.errors import FileError, InputError
from uav_bt.protocols import silent
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats32, Image

SIZE = (960, 540)
TRUE = anafi_camera(*SIZE)


def photograph(turn_rad: Sequence[float], middle_m: Sequence[float]) -> Image:
    """Draw the paper's board of 25x14 squares of 2 cm, turned, at a place before the lens."""
    checks = np.add.outer(np.arange(14), np.arange(25)) % 2
    bordered = np.pad(20 + 200 * checks, 1, constant_values=235).astype(np.uint8)
    texture = bordered.repeat(16, axis=0).repeat(16, axis=1)
    to_m = np.diag([0.02 / 16, 0.02 / 16, 1.0])
    to_m[:2, 2] = 0.02 * (0.5 / 16 - np.array([27, 16]) / 2)
    rotation, _ = cv2.Rodrigues(np.array(turn_rad))
    seen = TRUE.matrix @ np.column_stack([rotation[:, :2], middle_m]) @ to_m
    finer = np.array([[3.0, 0, 1], [0, 3, 1], [0, 0, 1]])  # three pixels for each
    large = (3 * SIZE[0], 3 * SIZE[1])
    drawn = cv2.warpPerspective(texture, finer @ seen, large, borderValue=(120,))
    return np.asarray(cv2.resize(drawn, SIZE, interpolation=cv2.INTER_AREA), np.uint8)


def named(images: Sequence[Image]) -> dict[str, Callable[[], Image]]:
    return {f"{index}.png": (lambda image=image: image) for index, image in enumerate(images)}


@pytest.fixture(scope="module")
def whole() -> list[Image]:
    """Return photographs of the whole board from many sides."""
    rng = np.random.default_rng(6)
    images = []
    for _ in range(12):
        middle_m = (*rng.uniform((-0.08, -0.05), (0.08, 0.05)), rng.uniform(0.55, 0.8))
        images.append(photograph((*rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.1, 0.1)), middle_m))
    return images


def assert_like(camera: CameraModel, true: CameraModel) -> None:
    """Assert a calibration's accuracy: 0.2 % of the focal length, 0.5 px of the centre."""
    assert camera.pinhole_px[:2] == pytest.approx(true.pinhole_px[:2], rel=2e-3)
    assert camera.pinhole_px[2:] == pytest.approx(true.pinhole_px[2:], abs=0.5)


def test_the_camera_is_recovered_from_the_whole_board(whole: list[Image]) -> None:
    """Two more pictures cut the board: parts of it are layouts, too. One shows none."""
    cut = [photograph((0.1, 0.3, 0.0), place) for place in ((0.25, 0, 0.5), (-0.3, 0.1, 0.6))]
    calibration = calibrate(named([*whole, *cut, np.full_like(whole[0], 120)]))
    best, layouts = calibration.best, [(t.columns, t.rows) for t in calibration.trials]
    assert_like(best.camera, TRUE)
    assert (best.camera.width_px, best.camera.height_px) == SIZE
    assert best.error_px < 0.2
    assert best.camera.distortion[:2] == pytest.approx((0.0, 0.0), abs=0.01)
    assert (best.columns, best.rows) == layouts[0] == (24, 13)
    assert len(best.images) == 12
    assert len(layouts) >= 2
    for trial in calibration.trials:
        assert trial.common_error_px >= 0.98 * best.common_error_px
        assert trial.corners <= best.corners
        assert trial.images
    first, second, third = (calibration.skipped.pop(f"{index}.png") for index in (12, 13, 14))
    assert "of 24x13 corners found" in first
    assert "of 24x13 corners found" in second
    assert (third, calibration.skipped) == ("no board found", {})


def apart_px(found: Floats32, true: Floats32) -> float:
    """Return the largest distance of corners: a board looks the same upside down."""
    return min(np.abs(grid - true).max() for grid in (found, found[::-1, ::-1]))


def test_a_lenss_distortion_is_found_and_taken_out(whole: list[Image]) -> None:
    """Pictures bent by a known lens: the calibration straightens them again."""
    pixels = np.indices(SIZE[::-1])[::-1].reshape(2, -1).T[:, None].astype(np.float64)
    bent_lens = np.array([-0.12, 0.03, 0.0, 0.0, 0.0])
    straight = cv2.undistortPoints(pixels, TRUE.matrix, bent_lens, P=TRUE.matrix)
    sources = straight.reshape(SIZE[1], SIZE[0], 2).astype(np.float32)
    bent = [np.asarray(cv2.remap(image, sources, None, cv2.INTER_LINEAR)) for image in whole]
    camera = calibrate(named(bent)).best.camera
    assert camera.distortion[0] == pytest.approx(-0.12, abs=0.01)
    assert camera.fx_px == pytest.approx(TRUE.fx_px, rel=2e-3)
    found = find_board(Undistorter(camera).undistort(bent[1]), 24, 13)
    assert apart_px(found, find_board(whole[1], 24, 13)) < 1.0


def test_large_and_turned_pictures_show_the_board(whole: list[Image]) -> None:
    """A large one is searched small and refined at full size."""
    large = np.asarray(cv2.resize(whole[4], None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC))
    large_board = find_any_board(large)
    assert apart_px((large_board + 0.5) / 2 - 0.5, find_any_board(whole[4])) < 0.3
    for turn in range(4):  # columns outnumber rows, and the grid is never mirrored
        board = find_any_board(np.ascontiguousarray(np.rot90(whole[4], turn)))
        assert board.shape == large_board.shape == (13, 24, 2)
        along, down = board[0, -1] - board[0, 0], board[-1, 0] - board[0, 0]
        assert along[0] * down[1] - along[1] * down[0] > 0.0


def test_pictures_that_are_broken_or_zoomed_are_left_out_and_named(whole: list[Image]) -> None:
    def broken() -> Image:
        raise FileError("broken.png", "is not a readable picture")

    near = whole[0][540 // 8 : -540 // 8, 960 // 8 : -960 // 8]
    zoomed = np.asarray(cv2.resize(near, SIZE), dtype=np.uint8)
    found = calibrate({**named(whole[:10]), "broken.png": broken, "zoomed.png": lambda: zoomed})
    assert found.skipped["zoomed.png"] == "does not fit the others"
    assert "not a readable picture" in found.skipped["broken.png"]
    assert_like(found.best.camera, TRUE)


def test_few_many_and_small_boards(whole: list[Image], monkeypatch: pytest.MonkeyPatch) -> None:
    small = np.asarray(cv2.resize(whole[0], None, fx=0.5, fy=0.5), dtype=np.uint8)
    boards, size_px, unusable = find_boards(named([small, *whole[:2]]), silent)
    assert (size_px, set(boards)) == (SIZE, {"1.png", "2.png"})
    assert unusable == {"0.png": "is 480x270, most photographs are 960x540 (width x height)"}
    blank = np.full((540, 960), 128, dtype=np.uint8)
    with pytest.raises(InputError, match=r"at least 3 photographs.*got 2 of 4"):
        calibrate(named([whole[0], blank, whole[1], blank]))
    with pytest.raises(InputError, match="none of 0"):
        calibrate({})
    monkeypatch.setattr(module, "_MAX_IMAGES", 6)
    found = calibrate(named(whole))
    assert len(found.best.images) == len(found.skipped) == 6
    assert set(found.skipped.values()) == {"6 others are enough"}


def test_copies_and_boards_that_no_camera_explains_are_no_calibration(whole: list[Image]) -> None:
    """The error of copies is low, and the focal length can be anything."""
    with pytest.raises(InputError, match=r"got 2 of 5 \(3 are copies of others\)"):
        calibrate(named([whole[0]] * 4 + [whole[1]]))
    skipped = calibrate(named([*whole[:6], whole[2]])).skipped
    assert skipped == {"6.png": "shows the board where 2.png does: it adds nothing"}
    squeezed = []  # each in another way, as by a zoom that changed
    for index, image in enumerate(whole[:6]):
        narrow = cv2.resize(image, None, fx=0.6 + 0.08 * index, fy=1.0)
        right_px = SIZE[0] - narrow.shape[1]
        squeezed.append(np.pad(narrow, ((0, 0), (0, right_px)), constant_values=120))
    with pytest.raises(InputError, match=r"no camera .*reprojection error, px: .*, at most 1"):
        calibrate(named(squeezed))


# Cameras that are refused or doubted although their reprojection error is low
LENS = {"fx_px": 520.0, "fy_px": 521.0, "cx_px": 322.0, "cy_px": 250.0}
GOOD = CameraModel(width_px=640, height_px=512, **LENS, distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))


def trial(error_px: float = 0.2, deviation_px: float = 0.2, **changes: Any) -> LayoutTrial:
    errors = {"error_px": error_px, "common_error_px": error_px, "deviation_px": deviation_px}
    camera = replace(GOOD, **changes)
    return LayoutTrial(columns=4, rows=3, images=("a",), camera=camera, **errors)


@pytest.mark.parametrize(("found", "words"), cases("perception")["calibrations"])
def test_a_camera_that_no_lens_has_is_refused(found: dict[str, Any], words: str) -> None:
    assert words in fault(trial(**found))
    assert bool(words) == bool(fault(trial(**found)))


def test_boards_in_the_middle_only_and_inaccurate_cameras_are_doubted() -> None:
    corners = np.stack(np.meshgrid(np.arange(4), np.arange(3)), axis=-1).astype(np.float32)
    (line,) = doubts(trial(), [20 * corners + np.float32([290, 230])])
    assert "seen in 1 of the image's 9 parts" in line
    everywhere = [190 * corners + np.float32([20, top_px]) for top_px in (20, 100)]
    assert doubts(trial(), everywhere) == ()
    (line,) = doubts(trial(deviation_px=1.2), everywhere)
    assert "known to 1.2 px (standard deviation), 1.0 px is good" in line
