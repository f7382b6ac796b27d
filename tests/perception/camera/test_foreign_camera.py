"""Camera files of ROS, OpenCV and Kalibr."""

from __future__ import annotations

from pathlib import Path

import pytest

from perception.camera.camera_file import load_camera
from uav_bt.errors import FileError
from uav_bt.types import CameraModel

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
KALIBR = """
cam0:
  camera_model: pinhole
  intrinsics: [465.6, 466.0, 320.5, 180.5]
  distortion_model: radtan
  distortion_coeffs: [-0.1, 0.05, 0.001, -0.002]
  resolution: [640, 360]
  rostopic: /cam0/image_raw
"""


def load(folder: Path, text: str) -> CameraModel:
    path = folder / "foreign.yaml"
    path.write_text(text, encoding="utf-8")
    return load_camera(path)


@pytest.mark.parametrize("text", [ROS, OPENCV, OPENCV.replace("%YAML:", "%YAML "), KALIBR])
def test_a_camera_of_another_tool_is_read(tmp_path: Path, text: str) -> None:
    camera = load(tmp_path, text)
    assert (camera.width_px, camera.height_px) == (640, 360)
    assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == (465.6, 466.0, 320.5, 180.5)
    assert camera.distortion[:4] == (-0.1, 0.05, 0.001, -0.002)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (KALIBR.replace("radtan", "equidistant"), "lens models .*, got equidistant; calibrate"),
        (ROS.replace("plumb_bob", "equidistant"), "lens models .*, got equidistant; calibrate"),
        (KALIBR.replace("pinhole", "omni"), "camera model pinhole, got omni"),
        (KALIBR.replace("[640, 360]", "640"), "resolution of width and height, got 640"),
        (KALIBR.replace(", 180.5]", "]"), "intrinsics fx, fy, cx, cy, got"),
        (ROS.replace("image_width: 640\n", ""), "image_width is absent"),
        (ROS.replace(", 0, 0, 1]}", "]}", 1), "camera_matrix must have 9 numbers, got 6"),
        (ROS.replace("465.6", "wide"), r"K.0.0: .*number, .* got 'wide'"),
        (ROS.replace("465.6", "-1"), "positive focal lengths"),
        (ROS.replace("{rows: 1, cols: 5, data: ", "").replace("-0.002, 0]}", "-0.002, 0]"), "rows"),
    ],
)
def test_an_unreadable_file_is_reported_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(FileError, match=words) as refused:
        load(tmp_path, text)
    assert "\n" not in str(refused.value)
