"""A live camera."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import cv2
import numpy as np

from uav_bt.app.perceive.sources.picture import FOLDER_RATE, Picture, Pictures
from uav_bt.errors import InputError
from uav_bt.protocols import Clock

__all__ = ["CAMERA", "CameraSource"]

CAMERA: Final = "camera:"  # before a device's number


class CameraSource:
    """A live camera, by OpenCV; without an end of its own.

    Args:
        number: of the device.
        clock: tells when a picture came.
        capture: opens a device.
    """

    def __init__(
        self, number: int, clock: Clock, *, capture: Callable[[int], Any] = cv2.VideoCapture
    ) -> None:
        self._number, self._clock, self._capture = number, clock, capture
        self.name = f"{CAMERA}{number}"
        self.total: int | None = None
        self.rate_per_s = FOLDER_RATE
        self.skipped: list[str] = []

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture until the camera stops.

        Raises:
            InputError: the camera does not open or sends nothing.
        """
        device = self._opened()
        try:
            index, begin_s = -1, self._clock.now()
            while device.grab():
                index += 1
                if index % every:
                    continue
                time_s = self._clock.now() - begin_s
                whole, bgr = device.retrieve()
                if not whole:
                    self.skipped.append(f"picture {index}: did not arrive whole")
                    continue
                rgb = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
                yield Picture(image=rgb, index=index, time_s=time_s, name=f"picture {index}")
        finally:
            device.release()
        if index < 0:
            raise InputError(f"camera {self._number} opens, but sends no pictures")
        self.skipped.append(f"the camera stopped after {index + 1} pictures")

    def _opened(self) -> Any:
        # OpenCV tells on the error stream what each of its back ends thinks of the number.
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            device = self._capture(self._number)
        finally:
            cv2.utils.logging.setLogLevel(level)
        if not device.isOpened():
            device.release()
            raise InputError(
                f"camera {self._number} does not open; is it plugged in, and free? "
                "(`ls /dev/video*` shows what there is)"
            )
        device.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest picture, not the oldest waiting one
        return device
