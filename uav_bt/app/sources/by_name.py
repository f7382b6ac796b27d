"""Sources of images by name: folders, flight records, videos and live cameras."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from perception.camera import image_files
from uav_bt.app.sources.shots import RATE, ImageSource, Shot, Shots
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.clock import WallClock
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.files import did_you_mean_file
from uav_bt.protocols import Clock
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RECORD_SUFFIX, RecordReader, flight_record, footage

_IMAGES: Final = (*image_files.IMAGE_SUFFIXES, *image_files.FOREIGN_SUFFIXES)
_CAMERA: Final = "camera:"  # before a device's number


def open_source(text: str, *, times_s: Sequence[float] | None = None) -> ImageSource:
    """Return the source that a text names: a video, a record, a folder, an image or `camera:N`.

    `times_s` are those of a folder's images, in their order; default: ten a second.
    """
    if text.startswith(_CAMERA):
        number = text.removeprefix(_CAMERA)
        if not re.fullmatch(r"\d{1,3}", number):
            raise InputError(f"expected a camera such as camera:0, got '{text}'")
        return CameraSource(int(number), WallClock())
    path = Path(text)
    suffix = path.suffix.lower()
    if path.is_dir() or (path.is_file() and suffix in _IMAGES):
        return FolderSource(path, times_s=times_s)
    if not path.is_file():
        raise FileError(
            path,
            f"there is no such video file or folder of images{did_you_mean_file(path)} "
            "(a live camera is camera:0)",
        )
    return RecordSource(flight_record(path)) if suffix == RECORD_SUFFIX else VideoSource(path)


class RecordSource(ImageSource):
    """The frames of a flight record."""

    def __init__(self, reader: RecordReader) -> None:
        found = (item for item in footage(reader) if isinstance(item, StoredFrame))
        times_s = np.array([item.note.captured_s for item in found])
        apart_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
        super().__init__(str(reader.path), len(times_s), 1.0 / apart_s if apart_s > 0.0 else RATE)
        self._reader = reader
        self._begin_s = float(times_s[0]) if times_s.size else 0.0

    def images(self, every: int = 1) -> Shots:
        """Iterate over every n-th frame."""
        frames = (item for item in footage(self._reader) if isinstance(item, StoredFrame))
        for index, stored in enumerate(frames):
            if index % every:
                continue
            try:
                image = stored.frame().image
            except InputError as error:
                self.skipped.append(f"frame {stored.note.index}: {error}")
                continue
            time_s = stored.note.captured_s - self._begin_s
            yield Shot.of(image, index=index, time_s=time_s, name=f"frame {index}")


class FolderSource(ImageSource):
    """The images of a folder by name, numbers by their value; or a single image.

    `times_s` are those of the images in their order, the unreadable ones included.
    """

    def __init__(self, path: Path, *, times_s: Sequence[float] | None = None) -> None:
        self._paths, foreign = ([path], "") if path.is_file() else image_files.image_files(path)
        self._paths.sort(key=_natural)
        if times_s is not None and len(times_s) != len(self._paths):
            expected = f"{len(times_s)}, as many as the telemetry has entries"
            raise ShapeError(f"images in {path}", expected=expected, actual=[len(self._paths)])
        self._times_s = times_s
        super().__init__(str(path), len(self._paths))
        self.skipped += [foreign] if foreign else []

    def images(self, every: int = 1) -> Shots:
        """Iterate over every n-th image."""
        for index in range(0, len(self._paths), every):
            path = self._paths[index]
            try:
                # Turned here and not by OpenCV, so that image and camera are turned alike.
                stored = image_files.read_image(path, colour=True, as_stored=True)
                orientation = image_files.exif_orientation(path)
            except FileError as error:
                self.skipped.append(str(error).replace(str(path), path.name, 1))
                continue
            image, times_s = orientation.image(stored), self._times_s
            time_s = index / RATE if times_s is None else float(times_s[index])
            yield Shot.of(
                image, index=index, time_s=time_s, name=path.name, orientation=orientation
            )


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that puts image_9 before image_10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name


class CameraSource(ImageSource):
    """A live camera, read by OpenCV. It never ends."""

    def __init__(self, number: int, clock: Clock) -> None:
        super().__init__(f"{_CAMERA}{number}", None)
        self._number = number
        self._clock = clock

    def images(self, every: int = 1) -> Shots:
        """Iterate over every n-th image until it stops; InputError if it sends nothing."""
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
                yield Shot.of(rgb, index=index, time_s=time_s, name=f"image {index}")
        finally:
            device.release()
        if index < 0:
            raise InputError(f"camera {self._number} opens, but sends no images")
        self.skipped.append(f"the camera stopped after {index + 1} images")

    def _opened(self) -> Any:
        # Each back end of OpenCV would write about the number to the error stream.
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        device = cv2.VideoCapture(self._number)
        cv2.utils.logging.setLogLevel(level)
        if not device.isOpened():
            device.release()
            raise InputError(
                f"camera {self._number} does not open; is it plugged in, and free? "
                "(`ls /dev/video*` shows what there is)"
            )
        device.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest image, not the oldest waiting one
        return device
