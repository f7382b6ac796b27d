"""Sources of frames by name: folders of images, flight records, videos and live cameras."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import (
    FOREIGN_SUFFIXES,
    IMAGE_SUFFIXES,
    exif_orientation,
    image_files,
    read_image,
)
from uav_bt.app.sources.streams import (
    CAMERA,
    FOLDER_RATE,
    CameraSource,
    ImageSource,
    TimedImage,
    TimedImages,
)
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.clock import WallClock
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.files import did_you_mean_file
from uav_bt.protocols import Clock
from uav_bt.record.footage import footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types.arrays import Image


def open_source(
    text: str, *, clock: Clock | None = None, times_s: Sequence[float] | None = None
) -> ImageSource:
    """Return the source that a text names; opens nothing that has to be closed.

    Args:
        text: a video file, a folder of images, an image, or `camera:N`.
        clock: of a live camera's times; default: the wall clock.
        times_s: of a folder's images, in their order; default: ten a second.

    Raises:
        FileError: there is no such file or folder, or it holds no images.
        InputError: the camera's number is invalid.
        ShapeError: the folder holds another number of images than there are times.
    """
    if text.startswith(CAMERA):
        number = text.removeprefix(CAMERA)
        if not re.fullmatch(r"\d{1,3}", number):
            raise InputError(f"expected a camera such as camera:0, got '{text}'")
        return CameraSource(int(number), clock or WallClock())
    path = Path(text)
    if path.is_dir():
        return FolderSource(path, times_s=times_s)
    if not path.is_file():
        raise FileError(
            path,
            f"there is no such video file or folder of images{did_you_mean_file(path)} "
            "(a live camera is camera:0)",
        )
    if path.suffix.lower() in (*IMAGE_SUFFIXES, *FOREIGN_SUFFIXES):
        return FolderSource(path, times_s=times_s)
    return VideoSource(path)


class RecordSource:
    """The frames of a flight record.

    Args:
        reader: of the record.
        times_s: (N,) of its frames, rising.
    """

    def __init__(self, reader: RecordReader, times_s: NDArray[np.float64]) -> None:
        self._reader, self._times_s = reader, times_s
        self.name = str(reader.path)
        self.total: int | None = len(times_s)
        between_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
        self.rate_per_s = 1.0 / between_s if between_s > 0.0 else FOLDER_RATE
        self.skipped: list[str] = []

    def images(self, every: int = 1) -> TimedImages:
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
            time_s = float(self._times_s[index])
            yield TimedImage(image=image, index=index, time_s=time_s, name=f"frame {index}")


class FolderSource:
    """The images of a folder by name, numbers in them by their value; or a single image.

    Args:
        path: the folder or the image.
        times_s: of the images in their order, the unreadable ones included.

    Raises:
        FileError: the folder holds no images.
        ShapeError: the number of times is another.
    """

    def __init__(self, path: Path, *, times_s: Sequence[float] | None = None) -> None:
        foreign = ""
        if path.is_file():
            self._paths = [path]
        else:
            self._paths, foreign = image_files(path)
            self._paths.sort(key=_natural)
        if times_s is not None and len(times_s) != len(self._paths):
            expected = f"{len(times_s)}, as many as the telemetry has entries"
            raise ShapeError(f"images in {path}", expected=expected, actual=[len(self._paths)])
        self._times_s = times_s
        self.name = str(path)
        self.total: int | None = len(self._paths)
        self.rate_per_s = FOLDER_RATE
        self.skipped: list[str] = [foreign] if foreign else []

    def images(self, every: int = 1) -> TimedImages:
        """Iterate over every n-th image."""
        shape: tuple[int, ...] | None = None
        for index in range(0, len(self._paths), every):
            path = self._paths[index]
            image = self._read(path)
            if image is None:
                continue
            if shape is not None and image.shape != shape:
                self.skipped.append(
                    f"{path.name}: is {image.shape[1]}x{image.shape[0]}, "
                    f"the first image is {shape[1]}x{shape[0]}"
                )
                continue
            shape = image.shape
            time_s = index / FOLDER_RATE if self._times_s is None else self._times_s[index]
            yield TimedImage(
                image=image,
                index=index,
                time_s=float(time_s),
                name=path.name,
                orientation=exif_orientation(path),
            )

    def _read(self, path: Path) -> Image | None:
        try:
            return read_image(path, colour=True, as_stored=False)
        except FileError as error:
            self.skipped.append(str(error).replace(str(path), path.name, 1))
            return None


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that puts image_9 before image_10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name
