"""Undistortion: straight lines, points and pictures that agree, and a camera without distortion."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from perception.camera.undistortion import Undistorter
from uav_bt.errors import ShapeError
from uav_bt.types import CameraModel

BENT = CameraModel(
    width_px=200,
    height_px=100,
    fx_px=150.0,
    fy_px=150.0,
    cx_px=99.5,
    cy_px=49.5,
    distortion=(-0.2, 0.05, 0.001, -0.001, 0.0),
)
MATRIX = np.array([[150.0, 0, 99.5], [0, 150.0, 49.5], [0, 0, 1.0]])


def test_points_go_back_to_where_a_lens_without_distortion_sees_them() -> None:
    directions = np.array([[-0.5, -0.2, 1.0], [0.0, 0.0, 1.0], [0.4, 0.25, 1.0]])
    bent, _ = cv2.projectPoints(
        directions, np.zeros(3), np.zeros(3), MATRIX, np.array(BENT.distortion)
    )
    straight = Undistorter(BENT).points(bent.reshape(-1, 2))

    assert straight == pytest.approx(150.0 * directions[:, :2] + (99.5, 49.5), abs=0.05)


def test_a_bent_line_is_straightened() -> None:
    """A level line near the upper edge, drawn as the lens sees it."""
    along = np.linspace(-0.6, 0.6, 400)
    line = np.stack([along, np.full_like(along, -0.25), np.ones_like(along)], axis=1)
    bent, _ = cv2.projectPoints(line, np.zeros(3), np.zeros(3), MATRIX, np.array(BENT.distortion))
    picture = np.zeros((100, 200), dtype=np.uint8)
    places = np.rint(bent * 16).astype(np.int32)  # sixteenths of a pixel
    cv2.polylines(picture, [places], False, 255, 2, cv2.LINE_AA, 4)
    straight = Undistorter(BENT).undistort(picture)

    def spread(image: np.ndarray) -> float:
        rows = [np.average(np.arange(100), weights=image[:, c]) for c in range(30, 170, 10)]
        return float(np.ptp(rows))

    assert spread(picture) > 1.2
    assert spread(straight) < 0.5


def test_the_undistorted_camera_has_the_same_intrinsics_and_no_distortion() -> None:
    camera = Undistorter(BENT).camera
    assert camera.distortion == ()
    assert (camera.fx_px, camera.cx_px) == (BENT.fx_px, BENT.cx_px)


@pytest.mark.parametrize("distortion", [(), (0.0, 0.0, 0.0, 0.0, 0.0)])
def test_without_distortion_nothing_changes(distortion: tuple[float, ...]) -> None:
    camera = CameraModel(
        width_px=200,
        height_px=100,
        fx_px=150.0,
        fy_px=150.0,
        cx_px=99.5,
        cy_px=49.5,
        distortion=distortion,
    )
    undistorter = Undistorter(camera)
    picture = np.random.default_rng(0).integers(0, 255, (100, 200, 3), dtype=np.uint8)

    assert undistorter.undistort(picture) is picture
    assert undistorter.points(np.array([[3.0, 4.0]])) == pytest.approx(np.array([[3.0, 4.0]]))


def test_other_sizes_are_refused() -> None:
    undistorter = Undistorter(BENT)
    with pytest.raises(ShapeError, match="100x200"):
        undistorter.undistort(np.zeros((50, 100, 3), dtype=np.uint8))
    with pytest.raises(ShapeError, match=r"\.\.\.x2"):
        undistorter.points(np.zeros((4, 3)))
