"""Camera files: written, read, scaled, and refused with the reason."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from perception.camera.calibration import LayoutTrial
from perception.camera.camera_file import Undistorter, load_camera, write_camera
from perception.camera.orientation import Orientation
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
TRIAL = LayoutTrial(
    columns=24,
    rows=13,
    images=("a.png", "b.png", "c.png"),
    error_px=0.12345,
    common_error_px=0.2,
    camera=CAMERA,
    deviation_px=0.3,
)


def content(tmp_path: Path) -> dict[str, object]:
    path = tmp_path / "written.yaml"
    write_camera(path, TRIAL)
    loaded: dict[str, object] = yaml.safe_load(path.read_text(encoding="utf-8"))
    return loaded


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    write_camera(path, TRIAL)
    assert load_camera(path) == CAMERA


def test_the_file_says_what_it_was_made_from(tmp_path: Path) -> None:
    written = content(tmp_path)

    assert list(written) == [
        *("width_px", "height_px", "K", "distortion", "frames"),
        *("reprojection_error_px", "corners", "images_used"),
    ]
    assert written["K"] == [[931.0, 0.0, 640.25], [0.0, 930.5, 359.0], [0.0, 0.0, 1.0]]
    assert written["reprojection_error_px"] == 0.1235
    assert written["corners"] == [24, 13]
    assert written["images_used"] == 3


def test_a_camera_serves_other_sizes_of_its_aspect(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    write_camera(path, TRIAL)

    assert load_camera(path, size_px=(640, 360)) == CAMERA.resized(640, 360)
    assert load_camera(path, size_px=(854, 480)).fx_px == pytest.approx(931.0 * 854 / 1280)


def test_a_camera_of_raw_frames_is_turned_with_them(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    write_camera(path, TRIAL)
    quarter = Orientation(transpose=True, flip_columns=True)

    turned = load_camera(path, size_px=(720, 1280), orientation=quarter)
    assert (turned.fx_px, turned.fy_px) == (930.5, 931.0)
    assert (turned.cx_px, turned.cy_px) == (719.0 - 359.0, 640.25)
    path.write_text(yaml.safe_dump(content(tmp_path) | {"frames": "turned"}))
    assert load_camera(path, orientation=quarter) == CAMERA


@pytest.mark.parametrize("size", [(640, 480), (360, 640), (1280, 700)])
def test_another_aspect_is_refused_with_both(tmp_path: Path, size: tuple[int, int]) -> None:
    path = tmp_path / "camera.yaml"
    write_camera(path, TRIAL)
    with pytest.raises(ValueRangeError, match=f"1280x720.*images are {size[0]}x{size[1]}"):
        load_camera(path, size_px=size)


def test_the_lenss_place_may_be_given(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(content(tmp_path) | {"forward_offset_m": 0.07}))
    assert load_camera(path, forward_offset_m=0.2).forward_offset_m == 0.07
    path.write_text(yaml.safe_dump(content(tmp_path)))
    assert load_camera(path, forward_offset_m=0.2).forward_offset_m == 0.2
    assert load_camera(path).forward_offset_m == CameraModel.forward_offset_m


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"widht_px": 3}, "widht_px: unknown key; did you mean 'width_px'"),
        ({"width_px": 0}, "width_px: expected a number greater than 0, got '0'"),
        ({"height_px": "720"}, "height_px: expected a whole number, got '720'"),
        ({"height_px": True}, "height_px: expected a whole number, got 'true'"),
        ({"K": 3}, "K: expected a list, got '3'"),
        ({"K": [[1, 0], [0, 1]]}, "K[0]: expected a list of 3, got a list of 2"),
        ({"K": [[1, 0, 0], [0, 1]]}, "K[1]: expected a list of 3, got a list of 2"),
        ({"K": [[931, 5, 640], [0, 931, 359], [0, 0, 1]]}, "without skew"),
        ({"K": [[931, 0, 640], [0, 931, 359], [0, 0, 2]]}, "without skew"),
        ({"K": [[-931, 0, 640], [0, 931, 359], [0, 0, 1]]}, "K must have positive focal lengths"),
        ({"K": [[931, 0, 2640], [0, 931, 359], [0, 0, 1]]}, "centre within the image"),
        ({"K": [[float("nan"), 0, 640], [0, 931, 359], [0, 0, 1]]}, "a number, got '.nan'"),
        ({"distortion": [0.1, 0.2]}, "distortion must hold 0, 4, 5, 8, 12, 14 numbers, got 2"),
        ({"distortion": ["a", 0, 0, 0]}, "distortion[0]: expected a number, got 'a'"),
        ({"distortion": None}, "distortion: expected a list, got 'null'"),
        ({"forward_offset_m": "far"}, "forward_offset_m: expected a number, got 'far'"),
    ],
)
def test_a_malformed_file_is_refused_by_name(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(content(tmp_path) | changes), encoding="utf-8")
    with pytest.raises(FileError) as refused:
        load_camera(path)
    assert words in str(refused.value)
    assert str(path) in str(refused.value)


def test_missing_keys_and_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text("width_px: 3\n", encoding="utf-8")
    with pytest.raises(FileError) as refused:
        load_camera(path)
    assert str(refused.value).splitlines() == [
        f"{path}:1: lacks the key '{key}'" for key in ("height_px", "K", "distortion")
    ]
    with pytest.raises(FileError, match="cannot be written"):
        write_camera(tmp_path / "absent" / "camera.yaml", TRIAL)


def test_no_distortion_is_an_empty_list(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(content(tmp_path) | {"distortion": []}), encoding="utf-8")
    assert load_camera(path).distortion == ()


# --- files of ROS and OpenCV ---

ROS = """
image_width: 640
image_height: 360
camera_name: head_camera
camera_matrix: {rows: 3, cols: 3, data: [465.6, 0, 320.5, 0, 466, 180.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.05, 0.001, -0.002, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
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


def load(folder: Path, text: str) -> CameraModel:
    path = folder / "foreign.yaml"
    path.write_text(text, encoding="utf-8")
    return load_camera(path)


@pytest.mark.parametrize(
    "text",
    [
        ROS,
        OPENCV,
        OPENCV.replace("%YAML:", "%YAML "),
        OPENCV.replace("camera_matrix", "cameraMatrix").replace(
            "distortion_coefficients", "distCoeffs"
        ),
        OPENCV.replace("640", "0640"),
        OPENCV.replace(", 0. ]", " ]") + "fisheye_model: 0\n",
        OPENCV.replace(", 0. ]", " ]") + "distortion_model: plumb_bob\n",
    ],
)
def test_a_camera_of_another_tool_is_read(tmp_path: Path, text: str) -> None:
    camera = load(tmp_path, text)
    assert (camera.width_px, camera.height_px) == (640, 360)
    assert camera.pinhole_px == (465.6, 466.0, 320.5, 180.5)
    assert camera.distortion[:4] == (-0.1, 0.05, 0.001, -0.002)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROS.replace("plumb_bob", "equidistant"), "distortion_model: .*, got 'equidistant'"),
        (OPENCV + "fisheye_model: 1\n", "expected 0, a pinhole camera, got 1; calibrate"),
        (OPENCV.replace(", 0. ]", " ]"), "4 numbers may be those of a fisheye lens"),
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
def test_an_unreadable_file_is_reported_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(FileError, match=words) as refused:
        load(tmp_path, text)
    assert "\n" not in str(refused.value)


# --- distortion ---

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
    bent, _ = cv2.projectPoints(
        line, np.zeros(3), np.zeros(3), BENT.matrix, np.array(BENT.distortion)
    )
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


def test_other_sizes_are_refused() -> None:
    with pytest.raises(ShapeError, match="100x200"):
        Undistorter(BENT).undistort(np.zeros((50, 100, 3), dtype=np.uint8))
