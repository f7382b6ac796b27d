"""Take a lens's distortion out of images, so that straight edges are straight."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError
from uav_bt.types import CameraModel


class Undistorter:
    """Undistorts images of one camera; keeps the map from image to image.

    Args:
        camera: as calibrated, with its distortion, at the images' size.
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
        """Return the undistorted image; black where the lens saw nothing.

        Args:
            image: (H, W) or (H, W, 3) uint8 at the camera's size.

        Raises:
            ShapeError: it has another size.
        """
        size = (self._camera.height_px, self._camera.width_px)
        if image.shape[:2] != size:
            expected = f"{size[0]}x{size[1]}, as its camera"
            raise ShapeError("image", expected=expected, actual=image.shape)
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, *self._map, cv2.INTER_LINEAR), dtype=np.uint8)

    def points(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return where pixels of the distorted image are in the undistorted one.

        Args:
            pixels: (..., 2) column and row.

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
