"""Protocol of frame sources, and live cameras."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import cv2
import numpy as np

from perception.camera.image_files import UPRIGHT, Orientation
from uav_bt.errors import InputError
from uav_bt.protocols import Clock
from uav_bt.types.arrays import Image

FOLDER_RATE: Final = 10.0  # images a second where it is unknown: a mission's tick


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedImage:
    """One image of a source."""

    image: Image  # (H, W, 3) RGB
    index: int  # counts all images of the source, also those that are left out
    time_s: float  # since the source began
    name: str  # for messages
    orientation: Orientation = UPRIGHT  # from the stored image to this one


TimedImages = Generator[TimedImage, None, None]
"""TimedImages in order of time; closing lets go of the file or the camera."""


class ImageSource(Protocol):
    """Gives images of one size in order of time."""

    @property
    def name(self) -> str:
        """Name of the source in messages."""
        ...

    @property
    def total(self) -> int | None:
        """How many images it has; None where it is unknown."""
        ...

    @property
    def rate_per_s(self) -> float:
        """How many images a second, about."""
        ...

    @property
    def skipped(self) -> Sequence[str]:
        """Images that were skipped so far, with the reasons."""
        ...

    def images(self, every: int = 1) -> TimedImages:
        """Iterate over every n-th image. Unreadable images are skipped and reported."""
        ...


# --- live cameras ---------------------------------------------------------------------------------

CAMERA: Final = "camera:"  # before a device's number


class CameraSource:
    """A live camera, read by OpenCV. It never ends.

    Args:
        number: of the device.
        clock: gives the time at which an image came.
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

    def images(self, every: int = 1) -> TimedImages:
        """Iterate over every n-th image until the camera stops.

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
                    self.skipped.append(f"image {index}: did not arrive whole")
                    continue
                rgb = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
                yield TimedImage(image=rgb, index=index, time_s=time_s, name=f"image {index}")
        finally:
            device.release()
        if index < 0:
            raise InputError(f"camera {self._number} opens, but sends no images")
        self.skipped.append(f"the camera stopped after {index + 1} images")

    def _opened(self) -> Any:
        # Each back end of OpenCV would write about the number to the error stream.
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
        device.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest image, not the oldest waiting one
        return device
