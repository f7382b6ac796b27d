"""Calibration on drawn photographs of a board, whose camera is known exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from perception.camera import calibration as module
from perception.camera.calibration import Calibration, LayoutTrial, calibrate, doubts, fault
from perception.camera.camera_file import Undistorter
from perception.camera.checkerboards import find_any_board, find_board, find_boards
from sim_bridge.anafi import anafi_camera
from uav_bt.errors import FileError, InputError
from uav_bt.progress import silent
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
    drawn = cv2.warpPerspective(
        texture,
        finer @ seen,
        (3 * SIZE[0], 3 * SIZE[1]),
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(120,),
    )
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


@pytest.fixture(scope="module")
def calibration(whole: list[Image]) -> Calibration:
    """Return the camera found from them, from two that cut the board, and one without it."""
    cut = [photograph((0.1, 0.3, 0.0), place) for place in ((0.25, 0, 0.5), (-0.3, 0.1, 0.6))]
    return calibrate(named([*whole, *cut, np.full_like(whole[0], 120)]))


def assert_like(camera: CameraModel, true: CameraModel) -> None:
    """Assert a calibration's accuracy: 0.2 % of the focal length, 0.5 px of the centre."""
    assert camera.pinhole_px[:2] == pytest.approx(true.pinhole_px[:2], rel=2e-3)
    assert camera.pinhole_px[2:] == pytest.approx(true.pinhole_px[2:], abs=0.5)


def test_the_camera_is_recovered(calibration: Calibration) -> None:
    best = calibration.best

    assert_like(best.camera, TRUE)
    assert (best.camera.width_px, best.camera.height_px) == SIZE
    assert best.error_px < 0.2
    assert best.camera.distortion[:2] == pytest.approx((0.0, 0.0), abs=0.01)


def test_the_whole_board_wins_over_its_parts(calibration: Calibration) -> None:
    """Parts of it in cut pictures are layouts, too, and reported; fewer corners do not win."""
    best, layouts = calibration.best, [(t.columns, t.rows) for t in calibration.trials]

    assert (best.columns, best.rows) == (24, 13)
    assert len(best.images) == 12
    assert len(layouts) >= 2
    assert layouts[0] == (24, 13)
    for trial in calibration.trials:
        assert trial.common_error_px >= 0.98 * best.common_error_px
        assert trial.corners <= best.corners
        assert trial.images


def test_pictures_without_the_whole_board_are_skipped_and_named(calibration: Calibration) -> None:
    assert set(calibration.skipped) == {"12.png", "13.png", "14.png"}
    assert "of 24x13 corners found" in calibration.skipped["12.png"]
    assert "of 24x13 corners found" in calibration.skipped["13.png"]
    assert calibration.skipped["14.png"] == "no board found"


def test_a_lenss_distortion_is_found_and_taken_out(whole: list[Image]) -> None:
    """Pictures bent by a known lens: the calibration straightens them again."""
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(np.float64)
    bent_lens = np.array([-0.12, 0.03, 0.0, 0.0, 0.0])
    straight = cv2.undistortPoints(pixels, TRUE.matrix, bent_lens, P=TRUE.matrix)
    sources = straight.reshape(SIZE[1], SIZE[0], 2).astype(np.float32)
    bent = [
        np.asarray(cv2.remap(image, sources, None, cv2.INTER_LINEAR), dtype=np.uint8)
        for image in whole
    ]
    camera = calibrate(named(bent)).best.camera

    assert camera.distortion[0] == pytest.approx(-0.12, abs=0.01)
    assert camera.fx_px == pytest.approx(TRUE.fx_px, rel=2e-3)
    board = find_board(Undistorter(camera).undistort(bent[1]), 24, 13)
    true = find_board(whole[1], 24, 13)
    assert true is not None
    assert min(np.abs(grid - true).max() for grid in (board, board[::-1, ::-1])) < 1.0


def test_large_pictures_are_searched_small_and_refined_at_full_size(whole: list[Image]) -> None:
    image = whole[4]
    large = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)
    small_board, large_board = find_any_board(image), find_any_board(large)

    assert large_board.shape == small_board.shape == (13, 24, 2)
    halved = (large_board + 0.5) / 2 - 0.5
    # A board looks the same upside down.
    apart = min(np.abs(grid - small_board).max() for grid in (halved, halved[::-1, ::-1]))
    assert apart < 0.3


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_a_board_is_found_however_it_is_turned(whole: list[Image], turn: int) -> None:
    """Columns outnumber rows, and the grid is never mirrored."""
    board = find_any_board(np.ascontiguousarray(np.rot90(whole[4], turn)))

    assert board.shape == (13, 24, 2)
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


def test_more_pictures_than_are_needed_are_thinned_out(
    whole: list[Image], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MAX_IMAGES", 6)
    found = calibrate(named(whole))

    assert len(found.best.images) == len(found.skipped) == 6
    assert set(found.skipped.values()) == {"6 others are enough"}


def test_too_few_boards_are_refused_with_the_count(whole: list[Image]) -> None:
    blank = np.full((540, 960), 128, dtype=np.uint8)
    with pytest.raises(InputError, match=r"at least 3 photographs.*got 2 of 4"):
        calibrate(named([whole[0], blank, whole[1], blank]))
    with pytest.raises(InputError, match="none of 0"):
        calibrate({})


def test_pictures_of_other_sizes_are_left_out_and_named(whole: list[Image]) -> None:
    """Also where the first one is of another size."""
    small = np.asarray(cv2.resize(whole[0], None, fx=0.5, fy=0.5), dtype=np.uint8)
    boards, size_px, unusable = find_boards(named([small, *whole[:2]]), silent)
    assert size_px == SIZE
    assert set(boards) == {"1.png", "2.png"}
    assert unusable == {"0.png": "is 480x270, most photographs are 960x540 (width x height)"}


def test_copies_of_a_photograph_are_no_calibration(whole: list[Image]) -> None:
    """Their error is low, and the focal length can be anything."""
    with pytest.raises(InputError, match=r"got 2 of 5 \(3 are copies of others\)"):
        calibrate(named([whole[0]] * 4 + [whole[1]]))
    skipped = calibrate(named([*whole[:6], whole[2]])).skipped
    assert skipped == {"6.png": "shows the board where 2.png does: it adds nothing"}


def test_boards_that_no_camera_explains_are_refused(whole: list[Image]) -> None:
    """Each photograph is squeezed in another way, as by a zoom that changed."""
    squeezed = []
    for index, image in enumerate(whole[:6]):
        narrow = cv2.resize(image, None, fx=0.6 + 0.08 * index, fy=1.0)
        canvas = np.full((540, 960), 120, np.uint8)
        canvas[:, : narrow.shape[1]] = narrow
        squeezed.append(canvas)
    with pytest.raises(InputError, match=r"no camera .*reprojection error, px: .*, at most 1"):
        calibrate(named(squeezed))


# --- cameras that are refused or doubted although their reprojection error is low -----------------

GOOD = CameraModel(
    width_px=640,
    height_px=512,
    fx_px=520.0,
    fy_px=521.0,
    cx_px=322.0,
    cy_px=250.0,
    distortion=(-0.1, 0.02, 0.0, 0.0, 0.0),
)


def trial(error_px: float = 0.2, deviation_px: float = 0.2, **changes: object) -> LayoutTrial:
    return LayoutTrial(
        columns=4,
        rows=3,
        images=("a",),
        error_px=error_px,
        common_error_px=error_px,
        camera=replace(GOOD, **changes),  # type: ignore[arg-type]
        deviation_px=deviation_px,
    )


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (trial(), ""),
        # 120 degrees wide, as of an action camera:
        (trial(fx_px=230.0, fy_px=230.0, distortion=(-0.25, 0.06, 0.0, 0.0, 0.0)), ""),
        (trial(16.99), "reprojection error, px: 17, at most 1"),
        (trial(fx_px=195.7, fy_px=296.5), "focal lengths 196, 296 px: -0.34, at most 0.05"),
        (trial(cx_px=60.0), "offset of the centre (60, 250) by the image's size: 0.405, at most"),
        (trial(cy_px=60.0), "offset of the centre (322, 60) by the image's size: 0.382, at most"),
        (trial(distortion=(0.1, -161.0, 0.0, 0.0, 0.0)), "distortion 0.1 -161 0 0 0: inf, at most"),
        (trial(distortion=(3.0, 0.0)), "distortion 3 0: 2.91, at most 2"),
        (trial(deviation_px=34.7), "deviation, 34.7 px, by focal length: 0.0667, at most 0.01"),
        (trial(deviation_px=float("nan")), "deviation, nan px"),
    ],
)
def test_a_camera_that_no_lens_has_is_refused(found: LayoutTrial, words: str) -> None:
    assert words in fault(found)
    assert bool(words) == bool(fault(found))


def board(left_px: float, top_px: float, spacing_px: float) -> Floats32:
    """Return 4x3 corners, the first at a place."""
    down, along = np.mgrid[:3, :4]
    grid = np.stack([left_px + spacing_px * along, top_px + spacing_px * down], axis=-1)
    return grid.astype(np.float32)


def test_boards_in_the_middle_only_and_inaccurate_cameras_are_doubted() -> None:
    (line,) = doubts(trial(), [board(290, 230, 20.0)])
    assert "seen in 1 of the image's 9 parts" in line
    everywhere = [board(20, 20, 190.0), board(20, 100, 190.0)]
    assert doubts(trial(), everywhere) == ()
    (line,) = doubts(trial(deviation_px=1.2), everywhere)
    assert "known to 1.2 px (standard deviation), 1.0 px is good" in line
