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
the lens ahead of the drone's centre. `Undistorter` removes the distortion from images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from perception.camera.calibration import LayoutTrial
from perception.camera.foreign_camera import foreign_camera
from perception.camera.orientation import UPRIGHT, Orientation
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.files import write_whole
from uav_bt.types import CameraModel
from uav_bt.yaml_file import read_yaml, yaml_text

_DISTORTIONS: Final = (0, 4, 5, 8, 12, 14)  # possible lengths of OpenCV's distortion vectors
_REMEDY: Final = "`uav-bt lab calibrate` makes one"
_ASPECT_SLACK: Final = 0.01  # relative; 1280x720 and 854x480 are both 16:9


def write_camera(path: Path, trial: LayoutTrial) -> None:
    """Write the camera of a layout.

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
    """Read a camera file, our own or one of ROS, OpenCV or Kalibr.

    Args:
        path: the YAML file.
        size_px: width and height of the images; the camera is scaled to it. None: as calibrated.
        orientation: orientation of the images relative to the stored ones.
        forward_offset_m: distance of the lens ahead of the drone's centre, if the file has none.

    Raises:
        FileError: the file is absent or malformed.
        ValueRangeError: the camera was calibrated at another aspect ratio than the images'.
    """
    file = _foreign(path) or read_yaml(path, _CameraFile, "camera file", remedy=_REMEDY).value
    camera = file.camera(forward_offset_m)
    if file.frames == "raw":
        camera = orientation.camera(camera)
    return camera if size_px is None else fitted_camera(camera, *size_px, source=str(path))


def _foreign(path: Path) -> _CameraFile | None:
    content = foreign_camera(path) if path.is_file() else None
    if content is None:
        return None
    try:
        return _CAMERA_FILE.validate_python(content)
    except ValidationError as error:
        item = error.errors(include_url=False)[0]
        place = ".".join(map(str, item["loc"]))
        raise FileError(path, f"{place}: {item['msg']}, got '{item['input']}'") from error


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
        if not (
            fx > 0.0 and fy > 0.0 and 0.0 <= cx <= self.width_px and 0.0 <= cy <= self.height_px
        ):
            raise ValueRangeError(
                "K must have positive focal lengths and its centre within the image, got "
                f"f = ({fx}, {fy}), c = ({cx}, {cy}) for {self.width_px}x{self.height_px}"
            )
        if len(self.distortion) not in _DISTORTIONS:
            known = ", ".join(map(str, _DISTORTIONS))
            raise ValueRangeError(
                f"distortion must hold {known} numbers, got {len(self.distortion)}"
            )

    def camera(self, forward_offset_m: float) -> CameraModel:
        (fx, _, cx), (_, fy, cy), _ = self.K
        return CameraModel(
            width_px=self.width_px,
            height_px=self.height_px,
            fx_px=fx,
            fy_px=fy,
            cx_px=cx,
            cy_px=cy,
            distortion=self.distortion,
            forward_offset_m=(
                forward_offset_m if self.forward_offset_m is None else self.forward_offset_m
            ),
        )


_CAMERA_FILE: Final = TypeAdapter(_CameraFile)


def fitted_camera(
    camera: CameraModel, width_px: int, height_px: int, *, source: str = "the camera"
) -> CameraModel:
    """Return a camera scaled to another image size of the same aspect.

    Raises:
        ValueRangeError: the aspect ratios differ: the image was cropped or comes from another
            camera.
    """
    aspect, wanted = camera.width_px / camera.height_px, width_px / height_px
    if abs(aspect / wanted - 1.0) > _ASPECT_SLACK:
        raise ValueRangeError(
            f"{source} was calibrated at {camera.width_px}x{camera.height_px} (aspect "
            f"{aspect:.3f}), the images are {width_px}x{height_px} (aspect {wanted:.3f}): "
            "calibrate with images of the video that is flown with"
        )
    return camera.resized(width_px, height_px)


class Undistorter:
    """Undistorts images of one camera; the undistortion map is computed once.

    Args:
        camera: the camera with its distortion, at the images' size.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        self._map: tuple[Any, Any] | None = None
        self._matrix = np.array(
            [[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]]
        )
        self._distortion = np.array(camera.distortion)
        if any(camera.distortion):
            size = camera.width_px, camera.height_px
            self._map = cv2.initUndistortRectifyMap(
                self._matrix, self._distortion, np.eye(3), self._matrix, size, cv2.CV_16SC2
            )

    @property
    def camera(self) -> CameraModel:
        """The camera of the undistorted images: the same intrinsics, no distortion."""
        return replace(self._camera, distortion=())

    def undistort(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the undistorted image; black outside the original image.

        Args:
            image: (H, W) or (H, W, 3) uint8 at the camera's size.

        Raises:
            ShapeError: the image has another size.
        """
        size = (self._camera.height_px, self._camera.width_px)
        if image.shape[:2] != size:
            expected = f"{size[0]}x{size[1]}, as its camera"
            raise ShapeError("image", expected=expected, actual=image.shape)
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, *self._map, cv2.INTER_LINEAR), dtype=np.uint8)

    def points(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the positions in the undistorted image of pixels of the distorted one.

        Args:
            pixels: (..., 2) column and row, px.

        Raises:
            ShapeError: the last axis is not column and row.
        """
        if pixels.shape[-1:] != (2,):
            raise ShapeError("pixels", expected="...x2", actual=pixels.shape)
        if self._map is None:
            return np.asarray(pixels, dtype=np.float64)
        flat = np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        straight = cv2.undistortPoints(flat, self._matrix, self._distortion, P=self._matrix)
        return np.asarray(straight, dtype=np.float64).reshape(pixels.shape)
