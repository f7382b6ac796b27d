"""Cameras from files, and the ground plane that they see."""

import math
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.camera import ground_plane
from perception.camera.calibration import LayoutTrial
from perception.camera.camera_file import Undistorter, load_camera, write_camera
from perception.camera.ground_plane import CameraView, ground_depth, level_rays, ray_lengths
from perception.camera.image_files import Orientation
from tests.worlds import values
from tests.worlds.tables import cases
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.testing import pinhole
from uav_bt.types import Attitude, CameraModel
from uav_bt.types.projection import pixel_rays, project

SIZE = {"width_px": 1280, "height_px": 720}
PINHOLE = {"fx_px": 931.0, "fy_px": 930.5, "cx_px": 640.25, "cy_px": 359.0}
CAMERA = CameraModel(**SIZE, **PINHOLE, distortion=(0.01, -0.02, 0.0, 0.001, 0.0))
WRITTEN = {
    **SIZE,
    "K": [[931.0, 0.0, 640.25], [0.0, 930.5, 359.0], [0.0, 0.0, 1.0]],
    "distortion": [0.01, -0.02, 0.0, 0.001, 0.0],
    "frames": "raw",
    "reprojection_error_px": 0.1235,
    "corners": [24, 13],
    "images_used": 3,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a camera file."""
    images, errors = ("a.png", "b.png", "c.png"), {"error_px": 0.12345, "common_error_px": 0.2}
    found = {"columns": 24, "rows": 13, "images": images, "deviation_px": 0.3, "camera": CAMERA}
    write_camera(tmp_path / "camera.yaml", LayoutTrial(**errors, **found))
    return tmp_path / "camera.yaml"


def changed(path: Path, **changes: object) -> Path:
    path.write_text(yaml.safe_dump(WRITTEN | changes), encoding="utf-8")
    return path


def test_what_is_written_is_read_again_at_any_size_of_its_aspect(path: Path) -> None:
    written = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert (written, list(written)) == (WRITTEN, list(WRITTEN))
    assert load_camera(path) == CAMERA
    assert load_camera(path, size_px=(640, 360)) == CAMERA.resized(640, 360)
    assert load_camera(path, size_px=(854, 480)).fx_px == pytest.approx(931.0 * 854 / 1280)
    for size in ((640, 480), (360, 640), (1280, 700)):
        with pytest.raises(ValueRangeError, match=f"1280x720.*images are {size[0]}x{size[1]}"):
            load_camera(path, size_px=size)


def test_a_camera_of_raw_frames_is_turned_and_the_place_of_the_lens_is_optional(path: Path) -> None:
    quarter = Orientation(transpose=True, flip_columns=True)
    turned = load_camera(path, size_px=(720, 1280), orientation=quarter)
    assert turned.pinhole_px == (930.5, 931.0, 719.0 - 359.0, 640.25)
    assert load_camera(path).forward_offset_m == CameraModel.forward_offset_m
    assert load_camera(path, forward_offset_m=0.2).forward_offset_m == 0.2
    assert load_camera(changed(path, frames="turned"), orientation=quarter) == CAMERA
    assert load_camera(changed(path, distortion=[])).distortion == ()
    placed = changed(path, forward_offset_m=0.07)
    assert load_camera(placed, forward_offset_m=0.2).forward_offset_m == 0.07


@pytest.mark.parametrize(("changes", "words"), cases("perception")["camera_files"])
def test_a_malformed_file_is_refused_by_name(path: Path, changes: dict, words: str) -> None:
    with pytest.raises(FileError, match=re.escape(words)) as refused:
        load_camera(changed(path, **changes))
    assert str(path) in str(refused.value)


def test_missing_keys_and_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    with pytest.raises(FileError, match="no such camera file; `uav-bt lab calibrate` makes one"):
        load_camera(path)
    path.write_text("width_px: 3\n", encoding="utf-8")
    with pytest.raises(FileError) as refused:
        load_camera(path)
    lacking = [f"{path}:1: lacks the key '{key}'" for key in ("height_px", "K", "distortion")]
    assert str(refused.value).splitlines() == lacking


# Files of ROS and OpenCV
ROS = """
image_width: 640
image_height: 360
camera_name: head_camera
camera_matrix: {rows: 3, cols: 3, data: [465.6, 0, 320.5, 0, 466, 180.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.05, 0.001, -0.002, 0]}
projection_matrix: {rows: 3, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}
"""
OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 360
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 465.6, 0., 320.5, 0., 466., 180.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.05, 0.001, -0.002, 0. ]
"""
FOUR = OPENCV.replace(", 0. ]", " ]")


def test_a_camera_of_another_tool_is_read(path: Path) -> None:
    for text in (
        ROS,
        OPENCV,
        OPENCV.replace("%YAML:", "%YAML "),
        OPENCV.replace("camera_m", "cameraM").replace("distortion_coefficients", "distCoeffs"),
        OPENCV.replace("640", "0640"),
        FOUR + "fisheye_model: 0\n",
        FOUR + "distortion_model: plumb_bob\n",
    ):
        path.write_text(text, encoding="utf-8")
        camera = load_camera(path)
        assert (camera.width_px, camera.height_px) == (640, 360)
        assert camera.pinhole_px == (465.6, 466.0, 320.5, 180.5)
        assert camera.distortion[:4] == (-0.1, 0.05, 0.001, -0.002)


@pytest.mark.parametrize(("old", "new", "words"), cases("perception")["other_cameras"])
def test_an_unreadable_file_is_reported_in_one_line(
    path: Path, old: str, new: str, words: str
) -> None:
    path.write_text((ROS if old in ROS else OPENCV).replace(old, new, 1), encoding="utf-8")
    with pytest.raises(FileError, match=words) as refused:
        load_camera(path)
    assert "\n" not in str(refused.value)


BENT_LENS = (-0.2, 0.05, 0.001, -0.001, 0.0)
BENT = replace(pinhole(200, 100), fx_px=150.0, fy_px=150.0, distortion=BENT_LENS)


def test_a_bent_line_is_straightened() -> None:
    """A level line near the upper edge, drawn as the lens sees it."""
    along = np.linspace(-0.6, 0.6, 400)
    line = np.stack([along, np.full_like(along, -0.25), np.ones_like(along)], axis=1)
    still, distortion = np.zeros(3), np.array(BENT_LENS)
    bent, _ = cv2.projectPoints(line, still, still, BENT.matrix, distortion)
    picture = np.zeros((100, 200), dtype=np.uint8)
    places = np.rint(bent * 16).astype(np.int32)  # sixteenths of a pixel
    cv2.polylines(picture, [places], False, 255, 2, cv2.LINE_AA, 4)
    undistorter = Undistorter(BENT)
    assert undistorter.camera == replace(BENT, distortion=())
    before, after = (
        np.array([np.average(np.arange(100), weights=image[:, c]) for c in range(30, 170, 10)])
        for image in (picture, undistorter.undistort(picture))
    )
    assert np.ptp(before) > 1.2
    assert after == pytest.approx(49.5 - 150 * 0.25, abs=0.4)
    with pytest.raises(ShapeError, match="100x200"):
        undistorter.undistort(np.zeros((50, 100, 3), dtype=np.uint8))
    for none in ((), (0.0, 0.0, 0.0, 0.0, 0.0)):
        assert Undistorter(replace(BENT, distortion=none)).undistort(picture) is picture


# --- the ground plane in the image ----------------------------------------------------------------

SMALL = replace(pinhole(41, 21), fx_px=20.0, fy_px=16.0, forward_offset_m=0.2)


def view(pitch_deg: float = -30.0, height_m: float = 1.5, roll_deg: float = 0.0) -> CameraView:
    pitch_rad, roll_rad = math.radians(pitch_deg), math.radians(roll_deg)
    return CameraView(camera=SMALL, pitch_rad=pitch_rad, height_m=height_m, roll_rad=roll_rad)


def test_the_ground_is_where_trigonometry_says() -> None:
    depth = ground_depth(view(pitch_deg=-30.0, height_m=1.5))
    assert depth[10, 20] == pytest.approx(3.0)
    assert (depth.dtype, depth.shape) == (np.float32, (21, 41))
    raised = ground_depth(view(), plane_m=0.4)
    assert raised[15, 7] == pytest.approx(depth[15, 7] * 1.1 / 1.5)
    level = ground_depth(view(pitch_deg=0.0))
    assert np.isnan(level[:11]).all()
    assert np.isfinite(level[11:]).all()
    rolled = ground_depth(view(roll_deg=10.0))  # to the right, where the ground is nearer
    assert rolled[10, 20] == pytest.approx(3.0)
    assert rolled[10, 30] < 2.9
    assert rolled[10, 10] > 3.1
    # Straight down, depth along the optical axis is the height everywhere; the range is not.
    down = ground_depth(view(pitch_deg=-90.0, height_m=1.2))
    assert down == pytest.approx(np.full((21, 41), 1.2), rel=1e-6)
    range_m = down * ray_lengths(SMALL)
    assert range_m[10, [20, 40]] == pytest.approx([1.2, 1.2 * math.sqrt(2.0)])


@settings(deadline=None, max_examples=30)
@given(st.floats(-1.5, 0.4), st.floats(-0.4, 0.4))
def test_rays_of_the_grid_are_those_of_the_pixels(pitch_rad: float, roll_rad: float) -> None:
    grid = CameraView(camera=SMALL, pitch_rad=pitch_rad, height_m=1.0, roll_rad=roll_rad)
    columns, rows = np.meshgrid(np.arange(41), np.arange(21))
    pixels = np.stack([columns, rows], axis=-1)
    expected = pixel_rays(pixels, SMALL, pitch_rad, roll_rad)
    assert np.moveaxis(level_rays(grid), 0, -1) == pytest.approx(expected, abs=1e-5)
    there = project(expected, SMALL, pitch_rad, roll_rad)
    assert there == pytest.approx(pixels.astype(float), abs=1e-6)


def test_the_lens_rises_with_the_nose_and_the_gimbal_holds_its_pitch() -> None:
    """Of the body's attitude only the lever of the lens ahead of its centre matters."""
    frame = values.frame((4, 8), attitude=Attitude(pitch_rad=0.1, roll_rad=0.3, yaw_rad=1.0))
    seen = ground_plane.view_of(frame, SMALL, (82, 42))
    assert seen.height_m == pytest.approx(1.5 + 0.2 * math.sin(0.1))
    assert seen.pitch_rad == -0.5
    assert seen.camera == SMALL.resized(82, 42)


def test_impossible_views_are_refused() -> None:
    for height_m in (0.0, -1.0):
        with pytest.raises(ValueRangeError, match="above the plane"):
            ground_depth(view(height_m=height_m))
    for pitch_rad, height_m in ((0.0, math.nan), (math.inf, 1.0), (1.7, 1.0)):
        with pytest.raises(ValueRangeError, match="finite height"):
            CameraView(camera=SMALL, pitch_rad=pitch_rad, height_m=height_m)
