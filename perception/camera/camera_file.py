"""Camera files: what a calibration found, as YAML that people read and flights check.

    width_px: 1280
    height_px: 720
    K:
    - [931.2, 0.0, 639.5]
    - [0.0, 931.2, 359.5]
    - [0.0, 0.0, 1.0]
    distortion: [0.0, 0.0, 0.0, 0.0, 0.0]
    reprojection_error_px: 0.08
    corners: [24, 13]
    images_used: 312

The first four are needed, the others tell where they come from. `forward_offset_m` may be added:
how far the lens is ahead of the drone's centre.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from perception.camera.calibration import LayoutTrial
from uav_bt.errors import FileError, ValueRangeError, did_you_mean
from uav_bt.types import CameraModel

__all__ = ["fitted_camera", "load_camera", "write_camera"]

_NEEDED: Final = ("width_px", "height_px", "K", "distortion")
_KNOWN: Final = (*_NEEDED, "reprojection_error_px", "corners", "images_used", "forward_offset_m")
_DISTORTIONS: Final = (0, 4, 5, 8, 12, 14)  # how many numbers OpenCV's models have
_ASPECT_SLACK: Final = 0.01  # of the aspect: 1280x720 and 854x480 are both 16:9


def write_camera(path: Path, trial: LayoutTrial) -> None:
    """Write the camera that a layout gave.

    Raises:
        FileError: the file cannot be written.
    """
    camera = trial.camera
    matrix = [
        [camera.fx_px, 0.0, camera.cx_px],
        [0.0, camera.fy_px, camera.cy_px],
        [0.0, 0.0, 1.0],
    ]
    content = {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "K": matrix,
        "distortion": list(camera.distortion),
        "reprojection_error_px": round(trial.error_px, 4),
        "corners": [trial.columns, trial.rows],
        "images_used": len(trial.images),
    }
    try:
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror}") from error


def load_camera(
    path: Path,
    *,
    size_px: tuple[int, int] | None = None,
    forward_offset_m: float = CameraModel.forward_offset_m,
) -> CameraModel:
    """Read a camera file.

    Args:
        path: the YAML file.
        size_px: width and height of the pictures it is for; the camera is scaled to it. As
            calibrated when None.
        forward_offset_m: of the lens ahead of the drone's centre, where the file does not say it.

    Raises:
        FileError: the file is absent or malformed.
        ValueRangeError: it was calibrated at another aspect than that of the pictures.
    """
    content = _read(path)
    unknown = [str(key) for key in content if key not in _KNOWN]
    if unknown:
        hint = did_you_mean(unknown[0], _KNOWN)
        raise FileError(path, f"unknown key '{unknown[0]}'{hint} (known: {', '.join(_KNOWN)})")
    missing = [key for key in _NEEDED if key not in content]
    if missing:
        raise FileError(path, f"a camera file needs {', '.join(missing)}")
    camera = _camera(path, {"forward_offset_m": forward_offset_m} | content)
    return camera if size_px is None else fitted_camera(camera, *size_px, source=str(path))


def fitted_camera(
    camera: CameraModel, width_px: int, height_px: int, *, source: str = "the camera"
) -> CameraModel:
    """Return a camera scaled to another picture size of the same aspect.

    Raises:
        ValueRangeError: the aspect is another, so that the picture was cropped or comes from
            another camera.
    """
    aspect, wanted = camera.width_px / camera.height_px, width_px / height_px
    if abs(aspect / wanted - 1.0) > _ASPECT_SLACK:
        raise ValueRangeError(
            f"{source} was calibrated at {camera.width_px}x{camera.height_px} (aspect "
            f"{aspect:.3f}), the pictures are {width_px}x{height_px} (aspect {wanted:.3f}): "
            "calibrate with pictures of the video that is flown with"
        )
    return camera.resized(width_px, height_px)


def _read(path: Path) -> dict[Any, Any]:
    if not path.is_file():
        raise FileError(path, "there is no such camera file; `uav-bt calibrate` makes one")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(path, f"cannot be read as UTF-8 text: {error}") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else None
        raise FileError(path, f"not valid YAML: {error.problem}", line) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise FileError(path, f"not valid YAML: {error}") from error
    if not isinstance(content, dict):
        raise FileError(path, "a camera file is a mapping with width_px, height_px, K, distortion")
    return content


def _camera(path: Path, content: dict[Any, Any]) -> CameraModel:
    width_px, height_px = (_whole(path, content, key) for key in ("width_px", "height_px"))
    matrix = _numbers(path, content["K"], "K", "a list of three lists of three finite numbers")
    if matrix.shape != (3, 3):
        raise FileError(path, f"K must be 3x3, got {'x'.join(map(str, matrix.shape))}")
    (fx, skew, cx), (zero, fy, cy), last = matrix
    if skew != 0.0 or zero != 0.0 or tuple(last) != (0.0, 0.0, 1.0):
        raise FileError(path, "K must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]: there is no skew")
    if not (fx > 0.0 and fy > 0.0 and 0.0 <= cx <= width_px and 0.0 <= cy <= height_px):
        raise FileError(
            path,
            "the focal lengths must be positive and the centre within the picture, got "
            f"f = ({fx}, {fy}), c = ({cx}, {cy}) for {width_px}x{height_px}",
        )
    distortion = _numbers(path, content["distortion"], "distortion", "a list of finite numbers")
    if distortion.ndim != 1 or distortion.size not in _DISTORTIONS:
        known = ", ".join(map(str, _DISTORTIONS))
        raise FileError(path, f"distortion must hold {known} numbers, got {distortion.size}")
    offset_m = content["forward_offset_m"]
    if not _is_number(offset_m):
        raise FileError(path, f"forward_offset_m must be a finite number, got {offset_m!r}")
    return CameraModel(
        width_px=width_px,
        height_px=height_px,
        fx_px=float(fx),
        fy_px=float(fy),
        cx_px=float(cx),
        cy_px=float(cy),
        distortion=tuple(float(value) for value in distortion),
        forward_offset_m=float(offset_m),
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _whole(path: Path, content: dict[Any, Any], key: str) -> int:
    value = content[key]
    if isinstance(value, bool) or not isinstance(value, int) or value <= 0:
        raise FileError(path, f"{key} must be a positive whole number, got {value!r}")
    return value


def _numbers(path: Path, value: object, key: str, expected: str) -> np.ndarray[Any, Any]:
    flat = value if isinstance(value, list) else [None]
    rows = [row if isinstance(row, list) else [row] for row in flat]
    if not all(_is_number(number) for row in rows for number in row):
        raise FileError(path, f"{key} must be {expected}, got {value!r}")
    if len({len(row) for row in rows}) > 1:
        raise FileError(path, f"{key} must be {expected}; its rows differ in length")
    return np.array(flat, dtype=np.float64)
