"""Camera files: written, read, scaled, and refused with the reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from perception.camera.calibration import LayoutTrial
from perception.camera.camera_file import Undistorter, load_camera, write_camera
from perception.camera.image_files import Orientation
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.types import CameraModel

CAMERA = CameraModel(
    width_px=1280,
    height_px=720,
    fx_px=931.0,
    fy_px=930.5,
    cx_px=640.25,
    cy_px=359.0,
    distortion=(0.01, -0.02, 0.0, 0.001, 0.0),
)
WRITTEN = {
    "width_px": 1280,
    "height_px": 720,
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
    trial = LayoutTrial(
        columns=24,
        rows=13,
        images=("a.png", "b.png", "c.png"),
        error_px=0.12345,
        common_error_px=0.2,
        camera=CAMERA,
        deviation_px=0.3,
    )
    write_camera(tmp_path / "camera.yaml", trial)
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


def test_a_camera_of_raw_frames_is_turned_with_them(path: Path) -> None:
    quarter = Orientation(transpose=True, flip_columns=True)

    turned = load_camera(path, size_px=(720, 1280), orientation=quarter)
    assert turned.pinhole_px == (930.5, 931.0, 719.0 - 359.0, 640.25)
    assert load_camera(changed(path, frames="turned"), orientation=quarter) == CAMERA


def test_distortion_and_the_place_of_the_lens_are_optional(path: Path) -> None:
    assert load_camera(path).forward_offset_m == CameraModel.forward_offset_m
    assert load_camera(path, forward_offset_m=0.2).forward_offset_m == 0.2
    assert load_camera(changed(path, distortion=[])).distortion == ()
    placed = changed(path, forward_offset_m=0.07)
    assert load_camera(placed, forward_offset_m=0.2).forward_offset_m == 0.07


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"widht_px": 3}, "widht_px: unknown key; did you mean 'width_px'"),
        ({"width_px": 0}, "width_px: expected a number greater than 0, got '0'"),
        ({"height_px": -1}, "height_px: expected a number greater than 0, got '-1'"),
        ({"K": [[1, 0, 0], [0, 1]]}, "K[1]: expected a list of 3, got a list of 2"),
        ({"K": [[931, 5, 640], [0, 931, 359], [0, 0, 1]]}, "without skew"),
        ({"K": [[931, 0, 640], [0, 931, 359], [0, 0, 2]]}, "without skew"),
        ({"K": [[-931, 0, 640], [0, 931, 359], [0, 0, 1]]}, "K must have positive focal lengths"),
        ({"K": [[931, 0, 640], [0, 0, 359], [0, 0, 1]]}, "K must have positive focal lengths"),
        ({"K": [[931, 0, 2640], [0, 931, 359], [0, 0, 1]]}, "centre within the image"),
        ({"K": [[931, 0, 640], [0, 931, -1], [0, 0, 1]]}, "centre within the image"),
        ({"distortion": [0.1, 0.2]}, "distortion must hold 0, 4, 5, 8, 12, 14 numbers, got 2"),
        ({"distortion": None}, "distortion: expected a list, got 'null'"),
    ],
)
def test_a_malformed_file_is_refused_by_name(
    path: Path, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(FileError) as refused:
        load_camera(changed(path, **changes))
    assert words in str(refused.value)
    assert str(path) in str(refused.value)


def test_missing_keys_and_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    with pytest.raises(FileError, match="no such camera file; `uav-bt lab calibrate` makes one"):
        load_camera(path)
    path.write_text("width_px: 3\n", encoding="utf-8")
    with pytest.raises(FileError) as refused:
        load_camera(path)
    assert str(refused.value).splitlines() == [
        f"{path}:1: lacks the key '{key}'" for key in ("height_px", "K", "distortion")
    ]


# --- files of ROS and OpenCV ----------------------------------------------------------------------

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


@pytest.mark.parametrize(
    "text",
    [
        ROS,
        OPENCV,
        OPENCV.replace("%YAML:", "%YAML "),
        OPENCV.replace("camera_m", "cameraM").replace("distortion_coefficients", "distCoeffs"),
        OPENCV.replace("640", "0640"),
        FOUR + "fisheye_model: 0\n",
        FOUR + "distortion_model: plumb_bob\n",
    ],
)
def test_a_camera_of_another_tool_is_read(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
    camera = load_camera(path)
    assert (camera.width_px, camera.height_px) == (640, 360)
    assert camera.pinhole_px == (465.6, 466.0, 320.5, 180.5)
    assert camera.distortion[:4] == (-0.1, 0.05, 0.001, -0.002)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROS.replace("plumb_bob", "equidistant"), "distortion_model: .*, got 'equidistant'"),
        (OPENCV + "fisheye_model: 1\n", "expected 0, a pinhole camera, got 1; calibrate with"),
        (FOUR, "4 numbers may be those of a fisheye lens"),
        (ROS.replace("image_width: 640\n", ""), "lacks the key 'image_width'"),
        (ROS.replace(", 0, 0, 1]}", "]}", 1), "camera_matrix must have 9 numbers, got 6"),
        (ROS.replace("465.6", "wide"), r":5: camera_matrix.data\[0\]: .*number, got 'wide'"),
        (ROS.replace("465.6", "-1"), "positive focal lengths"),
        (
            ROS.replace("{rows: 1, cols: 5, data: ", "").replace("-0.002, 0]}", "-0.002, 0]"),
            "distortion_coefficients: expected a mapping with data, got a list of 5",
        ),
    ],
)
def test_an_unreadable_file_is_reported_in_one_line(path: Path, text: str, words: str) -> None:
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=words) as refused:
        load_camera(path)
    assert "\n" not in str(refused.value)


# --- distortion -----------------------------------------------------------------------------------

BENT = CameraModel(
    width_px=200,
    height_px=100,
    fx_px=150.0,
    fy_px=150.0,
    cx_px=99.5,
    cy_px=49.5,
    distortion=(-0.2, 0.05, 0.001, -0.001, 0.0),
)


def test_a_bent_line_is_straightened() -> None:
    """A level line near the upper edge, drawn as the lens sees it."""
    along = np.linspace(-0.6, 0.6, 400)
    line = np.stack([along, np.full_like(along, -0.25), np.ones_like(along)], axis=1)
    still, distortion = np.zeros(3), np.array(BENT.distortion)
    bent, _ = cv2.projectPoints(line, still, still, BENT.matrix, distortion)
    picture = np.zeros((100, 200), dtype=np.uint8)
    places = np.rint(bent * 16).astype(np.int32)  # sixteenths of a pixel
    cv2.polylines(picture, [places], False, 255, 2, cv2.LINE_AA, 4)
    undistorter = Undistorter(BENT)
    assert undistorter.camera == replace(BENT, distortion=())

    def rows(image: np.ndarray) -> np.ndarray:
        middles = [np.average(np.arange(100), weights=image[:, c]) for c in range(30, 170, 10)]
        return np.array(middles)

    assert np.ptp(rows(picture)) > 1.2
    assert rows(undistorter.undistort(picture)) == pytest.approx(49.5 - 150 * 0.25, abs=0.4)
    with pytest.raises(ShapeError, match="100x200"):
        undistorter.undistort(np.zeros((50, 100, 3), dtype=np.uint8))


@pytest.mark.parametrize("distortion", [(), (0.0, 0.0, 0.0, 0.0, 0.0)])
def test_without_distortion_nothing_changes(distortion: tuple[float, ...]) -> None:
    picture = np.random.default_rng(0).integers(0, 255, (100, 200, 3), dtype=np.uint8)
    assert Undistorter(replace(BENT, distortion=distortion)).undistort(picture) is picture
