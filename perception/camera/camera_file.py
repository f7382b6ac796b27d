"""Camera files: the result of a calibration as YAML.

    width_px: 1280
    height_px: 720
    K:
    - [931.2, 0.0, 639.5]
    - [0.0, 931.2, 359.5]
    - [0.0, 0.0, 1.0]
    distortion: [0.0, 0.0, 0.0, 0.0, 0.0]
    frames: raw
    reprojection_error_px: 0.08
    corners: [24, 13]
    images_used: 312

The first four keys are required. `frames` states the images of the camera: images as they
are stored (`raw`, the default) or as a player turns them by the orientation in the file (`turned`).
The other keys document the origin of the numbers. `forward_offset_m` may be added: the distance of
the lens ahead of the drone's centre. Files of ROS (`camera_info`) and OpenCV are read, too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import cv2
import numpy as np
from pydantic import AliasChoices, ConfigDict, Field

from perception.camera.calibration import LayoutTrial
from perception.camera.image_files import UPRIGHT, Orientation
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.files import read_bounded, reading, write_whole
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Image
from uav_bt.yaml_file import MAX_BYTES, YamlFile, read_yaml, yaml_text

_DISTORTIONS: Final = (0, 4, 5, 8, 12, 14)  # possible lengths of OpenCV's distortion vectors
_ASPECT_SLACK: Final = 0.01  # relative; 1280x720 and 854x480 are both 16:9
_FOREIGN: Final = re.compile(r"^[^#\n]*\bcamera(_m|M)atrix[\"']?\s*:", re.MULTILINE)
# OpenCV writes this head, YAML wants a space; and this tag of a mapping.
_OPENCV: Final = re.compile(r"^%YAML:1\.0|!!opencv-matrix", re.MULTILINE)


def write_camera(path: Path, trial: LayoutTrial) -> None:
    """Write the camera of a layout; FileError if the file cannot be written."""
    camera = trial.camera
    content = {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "K": camera.matrix.tolist(),
        "distortion": list(camera.distortion),
        "frames": "raw",
        "reprojection_error_px": round(trial.error_px, 4),
        "corners": [trial.columns, trial.rows],
        "images_used": len(trial.images),
    }
    write_whole(path, yaml_text(content))


def load_camera(
    path: Path,
    *,
    size_px: tuple[int, int] | None = None,
    orientation: Orientation = UPRIGHT,
    forward_offset_m: float = CameraModel.forward_offset_m,
) -> CameraModel:
    """Read a camera file, our own or one of ROS or OpenCV.

    The camera is scaled to images of width and height `size_px`, and turned by their orientation.
    `forward_offset_m` counts if the file has none. Images of another aspect ratio are refused.
    """
    file = _read(path)
    (fx, _, cx), (_, fy, cy), _ = file.K
    width, height, bent = file.width_px, file.height_px, file.distortion
    camera = CameraModel(
        width_px=width, height_px=height, fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=bent
    )
    offset_m = forward_offset_m if file.forward_offset_m is None else file.forward_offset_m
    camera = replace(camera, forward_offset_m=offset_m)
    if file.frames == "raw":
        camera = orientation.camera(camera)
    if size_px is None:
        return camera
    aspect, wanted = camera.width_px / camera.height_px, size_px[0] / size_px[1]
    if abs(aspect / wanted - 1.0) > _ASPECT_SLACK:
        raise ValueRangeError(
            f"{path} was calibrated at {camera.width_px}x{camera.height_px}, the images are "
            f"{size_px[0]}x{size_px[1]}: calibrate with images of the video that is flown with"
        )
    return camera.resized(*size_px)


_Row = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class _CameraFile:
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]
    K: tuple[_Row, _Row, _Row]
    distortion: tuple[float, ...]
    frames: Literal["raw", "turned"] = "raw"
    forward_offset_m: float | None = None
    # Origin of the numbers, not used:
    reprojection_error_px: Any = None
    corners: Any = None
    images_used: Any = None

    def __post_init__(self) -> None:
        (fx, skew, cx), (zero, fy, cy), last = self.K
        if skew != 0.0 or zero != 0.0 or last != (0.0, 0.0, 1.0):
            raise ValueRangeError("K must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], without skew")
        inside = 0.0 <= cx <= self.width_px and 0.0 <= cy <= self.height_px
        if not (fx > 0.0 and fy > 0.0 and inside):
            raise ValueRangeError(
                "K must have positive focal lengths and its centre within the image, got "
                f"f = ({fx}, {fy}), c = ({cx}, {cy}) for {self.width_px}x{self.height_px}"
            )
        if len(self.distortion) not in _DISTORTIONS:
            known, got = ", ".join(map(str, _DISTORTIONS)), len(self.distortion)
            raise ValueRangeError(f"distortion must hold {known} numbers, got {got}")


def _read(path: Path) -> _CameraFile:
    if path.is_file():
        with reading(path):
            text = read_bounded(path, MAX_BYTES).decode()
        if _FOREIGN.search(text):
            return YamlFile(path, _OPENCV.sub("", text), _ForeignFile).value.camera_file()
    remedy = "`uav-bt lab calibrate` makes one"
    return read_yaml(path, _CameraFile, "camera file", remedy=remedy).value


@dataclass(frozen=True, kw_only=True)
class _Matrix:
    __pydantic_config__: ClassVar = ConfigDict(strict=True, allow_inf_nan=False)

    data: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class _ForeignFile:
    """A camera file of ROS or OpenCV; its other keys are passed over."""

    __pydantic_config__: ClassVar = ConfigDict(strict=True, allow_inf_nan=False)

    image_width: Annotated[int, Field(gt=0)]
    image_height: Annotated[int, Field(gt=0)]
    camera_matrix: Annotated[
        _Matrix, Field(validation_alias=AliasChoices("camera_matrix", "cameraMatrix"))
    ]
    distortion_coefficients: Annotated[
        _Matrix, Field(validation_alias=AliasChoices("distortion_coefficients", "distCoeffs"))
    ] = _Matrix(data=())
    # Models whose numbers are OpenCV's k1, k2, p1, p2, k3, ...
    distortion_model: Literal["plumb_bob", "rational_polynomial", "radtan", "none"] | None = None
    fisheye_model: bool | int | None = None  # of OpenCV's program for calibration

    def __post_init__(self) -> None:
        if self.fisheye_model:
            raise ValueRangeError(
                f"fisheye_model: expected 0, a pinhole camera, got {self.fisheye_model}; calibrate "
                "with `uav-bt lab calibrate`"
            )
        untold = self.fisheye_model is None and self.distortion_model is None
        if untold and len(self.distortion_coefficients.data) == 4:
            raise ValueRangeError(
                "distortion_coefficients: 4 numbers may be those of a fisheye lens; if they are "
                "k1, k2, p1 and p2, add `distortion_model: plumb_bob`"
            )
        self.camera_file()

    def camera_file(self) -> _CameraFile:
        """Return the same camera as a file of ours."""
        numbers = self.camera_matrix.data
        if len(numbers) != 9:
            raise ValueRangeError(f"camera_matrix must have 9 numbers, got {len(numbers)}")
        a, b, c, d, e, f, g, h, i = numbers
        return _CameraFile(
            width_px=self.image_width,
            height_px=self.image_height,
            K=((a, b, c), (d, e, f), (g, h, i)),
            distortion=self.distortion_coefficients.data,
        )


class Undistorter:
    """Undistorts images of the size of one camera; the undistortion map is computed once."""

    def __init__(self, camera: CameraModel) -> None:
        self.camera = replace(camera, distortion=())
        """The camera of the undistorted images: the same intrinsics, no distortion."""
        self._map: tuple[Any, Any] | None = None
        if any(camera.distortion):
            size, matrix = (camera.width_px, camera.height_px), camera.matrix
            self._map = cv2.initUndistortRectifyMap(
                matrix, np.array(camera.distortion), np.eye(3), matrix, size, cv2.CV_16SC2
            )

    def undistort(self, image: Image) -> Image:
        """Return an undistorted image, (H, W) or (H, W, 3); black outside the original image."""
        height, width = self.camera.height_px, self.camera.width_px
        if image.shape[:2] != (height, width):
            expected = f"{height}x{width}, as its camera"
            raise ShapeError("image", expected=expected, actual=image.shape)
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, *self._map, cv2.INTER_LINEAR), dtype=np.uint8)
