"""Camera files of other tools: ROS camera_info, OpenCV's FileStorage and Kalibr's camchain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import FileError
from uav_bt.files import read_bounded, reading
from uav_bt.yaml_file import MAX_BYTES, YamlFile

_MATRIX: Final = "!!opencv-matrix"  # OpenCV's tag of a mapping
_OPENCV_HEAD: Final = "%YAML:1.0"  # OpenCV writes it, YAML wants a space
# Models whose numbers are OpenCV's k1, k2, p1, p2, k3, ...
_POLYNOMIAL: Final = ("plumb_bob", "rational_polynomial", "radtan", "none")
_SIZE_KEYS: Final = ("image_width", "image_height")
_MATRIX_KEYS: Final = ("camera_matrix", "cameraMatrix")
_DISTORTION_KEYS: Final = ("distortion_coefficients", "distCoeffs")


def foreign_camera(path: Path) -> dict[str, Any] | None:
    """Return the values of another tool's camera file under the keys of our camera files.

    Args:
        path: the file.

    Returns:
        `width_px`, `height_px`, `K` and `distortion`; None for a file of no known tool.

    Raises:
        FileError: the file cannot be read, lacks a value, or has a lens model other than OpenCV's.
    """
    with reading(path):
        text = read_bounded(path, MAX_BYTES).decode()
    text = text.replace(_OPENCV_HEAD, "", 1).replace(_MATRIX, "")
    try:
        content = YamlFile(path, text, dict[str, Any]).value
    except FileError:
        return None  # the reader of our own files gives the error
    kalibr = content.get("cam0")
    if isinstance(kalibr, Mapping):
        return _of_kalibr(path, kalibr)
    matrix_key = next((key for key in _MATRIX_KEYS if key in content), None)
    return None if matrix_key is None else _of_matrices(path, content, matrix_key)


def _of_matrices(path: Path, content: Mapping[Any, Any], matrix_key: str) -> dict[str, Any]:
    what = "a camera file of ROS or OpenCV"
    _check_model(path, what, content.get("distortion_model", "plumb_bob"))
    lacking = [key for key in _SIZE_KEYS if key not in content]
    if lacking:
        raise FileError(
            path, f"{what} must have {' and '.join(_SIZE_KEYS)}, {lacking[0]} is absent"
        )
    matrix = _numbers(path, content, matrix_key)
    if len(matrix) != 9:
        raise FileError(path, f"{matrix_key} must have 9 numbers, got {len(matrix)}")
    distortion_key = next((key for key in _DISTORTION_KEYS if key in content), None)
    return {
        "width_px": content["image_width"],
        "height_px": content["image_height"],
        "K": [matrix[0:3], matrix[3:6], matrix[6:9]],
        "distortion": _numbers(path, content, distortion_key) if distortion_key else [],
    }


def _numbers(path: Path, content: Mapping[Any, Any], key: str) -> list[Any]:
    matrix = content[key]
    data = matrix.get("data") if isinstance(matrix, Mapping) else None
    if not isinstance(data, list):
        raise FileError(path, f"{key} must be a matrix with rows, cols and data")
    return data


def _of_kalibr(path: Path, camera: Mapping[Any, Any]) -> dict[str, Any]:
    what = "a camera file of Kalibr"
    if camera.get("camera_model") != "pinhole":
        raise FileError(
            path, f"{what} must have the camera model pinhole, got {camera.get('camera_model')}"
        )
    _check_model(path, what, camera.get("distortion_model", "none"))
    size, intrinsics = camera.get("resolution"), camera.get("intrinsics")
    if not (isinstance(size, list) and len(size) == 2):
        raise FileError(path, f"{what} must have a resolution of width and height, got {size}")
    if not (isinstance(intrinsics, list) and len(intrinsics) == 4):
        raise FileError(path, f"{what} must have intrinsics fx, fy, cx, cy, got {intrinsics}")
    fx, fy, cx, cy = intrinsics
    return {
        "width_px": size[0],
        "height_px": size[1],
        "K": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        "distortion": camera.get("distortion_coeffs", []),
    }


def _check_model(path: Path, what: str, model: Any) -> None:
    if model not in _POLYNOMIAL:
        raise FileError(
            path,
            f"{what} must have one of the lens models {', '.join(_POLYNOMIAL)}, got {model}; "
            "calibrate with `uav-bt lab calibrate`",
        )
