"""Pictures that are in memory, or in files of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.app.perceive.sources.picture import FOLDER_RATE, Image, Picture, Pictures
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.record.footage import footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader

__all__ = ["PICTURE_SUFFIXES", "FolderSource", "RecordSource"]

PICTURE_SUFFIXES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")


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

    def pictures(self, every: int = 1) -> Pictures:
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
            yield Picture(image=image, index=index, time_s=time_s, name=f"frame {index}")


class FolderSource:
    """The pictures of a folder by name, numbers in them by their value; or a single picture.

    Args:
        path: the folder or the picture.
        times_s: of the pictures in their order, the unreadable ones included.

    Raises:
        FileError: the folder holds no pictures.
        ShapeError: the number of times is another.
    """

    def __init__(self, path: Path, *, times_s: Sequence[float] | None = None) -> None:
        self._paths = [path] if path.is_file() else _pictures_in(path)
        if times_s is not None and len(times_s) != len(self._paths):
            expected = f"{len(times_s)}, as many as the telemetry has entries"
            raise ShapeError(f"pictures in {path}", expected=expected, actual=[len(self._paths)])
        self._times_s = times_s
        self.name = str(path)
        self.total: int | None = len(self._paths)
        self.rate_per_s = FOLDER_RATE
        self.skipped: list[str] = []

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture."""
        shape: tuple[int, ...] | None = None
        for index in range(0, len(self._paths), every):
            path = self._paths[index]
            image = self._read(path)
            if image is None:
                continue
            if shape is not None and image.shape != shape:
                self.skipped.append(
                    f"{path.name}: is {image.shape[1]}x{image.shape[0]}, "
                    f"the first picture is {shape[1]}x{shape[0]}"
                )
                continue
            shape = image.shape
            time_s = index / FOLDER_RATE if self._times_s is None else self._times_s[index]
            yield Picture(image=image, index=index, time_s=float(time_s), name=path.name)

    def _read(self, path: Path) -> Image | None:
        try:
            encoded = np.fromfile(path, dtype=np.uint8)
        except OSError as error:
            self.skipped.append(f"{path.name}: cannot be read: {error.strerror}")
            return None
        # OpenCV raises on an empty buffer, and returns nothing for what is no picture.
        bgr = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
        if bgr is None:
            self.skipped.append(f"{path.name}: is not a readable picture")
            return None
        return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _pictures_in(folder: Path) -> list[Path]:
    found = [path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES]
    if not found:
        known = ", ".join(suffix.removeprefix(".") for suffix in PICTURE_SUFFIXES)
        raise FileError(folder, f"the folder holds no pictures ({known})")
    return sorted(found, key=_natural)


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key that puts picture_9 before picture_10."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts], path.name
