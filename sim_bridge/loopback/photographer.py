"""Photographs by the drone's camera.

It has a separate renderer and thread: an OpenGL context belongs to one thread, and the thread of
the video is busy with its frames.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.media import Photo
from sim_bridge.loopback.twin_camera import TwinCamera
from uav_bt.errors import DroneError

_QUALITY: Final = 92  # JPEG quality, per cent
_THUMBNAIL_PX: Final = (160, 90)


class Photographer:
    """Takes one photograph at a time; the first opens the camera.

    Args:
        camera: makes a camera for the exclusive use of this object.
    """

    def __init__(self, camera: Callable[[], TwinCamera]) -> None:
        self._make_camera = camera
        self._camera: TwinCamera | None = None  # used on the thread only
        self._closed = False
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="loopback-photos")

    def shoot(self) -> Future[Photo]:
        """Take a photograph."""
        return self._thread.submit(self._shoot)

    def close(self) -> None:
        """Finish the photograph in progress and free the camera; safe to call twice."""
        if not self._closed:
            self._closed = True
            self._thread.submit(self._free)
            self._thread.shutdown()

    def _free(self) -> None:
        if self._camera is not None:
            self._camera.close()

    def _shoot(self) -> Photo:
        if self._camera is None:
            self._camera = self._make_camera()
        frame = self._camera.newest()
        if frame is None or frame.captured_utc_s is None:
            raise DroneError("there is no image yet")
        height, width = frame.image.shape[:2]
        small = cv2.resize(frame.image, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA)
        return Photo(
            jpeg=_jpeg(frame.image),
            thumbnail=_jpeg(np.asarray(small, np.uint8)),
            size_px=(width, height),
            taken_utc_s=frame.captured_utc_s,
            location=frame.location,
        )


def _jpeg(rgb: NDArray[np.uint8]) -> bytes:
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
