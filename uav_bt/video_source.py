"""Pictures from a video file, a folder or a live camera, one after another."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.clock import WallClock
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.protocols import Clock

__all__ = [
    "PICTURE_SUFFIXES",
    "ArraySource",
    "CameraSource",
    "FolderSource",
    "Picture",
    "PictureSource",
    "Pictures",
    "VideoSource",
    "open_source",
]

Image = NDArray[np.uint8]

PICTURE_SUFFIXES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
_FOLDER_RATE: Final = 10.0  # pictures a second where nothing tells: a mission's tick
_UNKNOWN_RATE: Final = 25.0  # of a video file that does not say
_CAMERA: Final = "camera:"


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """One picture of a source."""

    image: Image  # (H, W, 3) RGB
    index: int  # counts all pictures of the source, also those that are left out
    time_s: float  # since the source began
    name: str  # for messages


Pictures = Generator[Picture, None, None]
"""Pictures in order of time; closing lets go of the file or the camera."""


class PictureSource(Protocol):
    """Gives pictures of one size in order of time."""

    @property
    def name(self) -> str:
        """What it is, for messages."""
        ...

    @property
    def total(self) -> int | None:
        """How many pictures it has; None where nobody knows."""
        ...

    @property
    def rate_per_s(self) -> float:
        """How many pictures a second, about."""
        ...

    @property
    def skipped(self) -> Sequence[str]:
        """What could not be used so far, and why."""
        ...

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture; what cannot be read is left out and told."""
        ...


def open_source(
    text: str, *, clock: Clock | None = None, times_s: Sequence[float] | None = None
) -> PictureSource:
    """Return the source that a text names; opens nothing that has to be closed.

    Args:
        text: a video file, a folder of pictures, a picture, or `camera:N`.
        clock: tells a live camera's times; default: the clock on the wall.
        times_s: of a folder's pictures, in their order; default: ten a second.

    Raises:
        FileError: there is no such file or folder, or it holds no pictures.
        InputError: the camera's number is none.
        ShapeError: the folder holds another number of pictures than there are times.
    """
    if text.startswith(_CAMERA):
        number = text.removeprefix(_CAMERA)
        if not re.fullmatch(r"\d{1,3}", number):
            raise InputError(f"expected a camera such as camera:0, got '{text}'")
        return CameraSource(int(number), clock or WallClock())
    path = Path(text)
    if path.is_dir():
        return FolderSource(path, times_s=times_s)
    if not path.is_file():
        raise FileError(
            path, "there is no such video file or folder of pictures (a live camera is camera:0)"
        )
    if path.suffix.lower() in PICTURE_SUFFIXES:
        return FolderSource(path, times_s=times_s)
    return VideoSource(path)


# --- kinds ----------------------------------------------------------------------------------------


class ArraySource:
    """Pictures that are in memory already.

    Args:
        name: for messages.
        images: (N, H, W, 3) uint8 RGB.
        times_s: (N,) rising.

    Raises:
        ShapeError: the numbers differ.
    """

    def __init__(self, name: str, images: Image, times_s: NDArray[np.float64]) -> None:
        if images.ndim != 4 or times_s.shape != images.shape[:1]:
            expected = f"{len(images)} (one for each picture)"
            raise ShapeError("times of pictures", expected=expected, actual=times_s.shape)
        self._images, self._times_s = images, times_s
        self.name = name
        self.total: int | None = len(images)
        between_s = float(np.median(np.diff(times_s))) if len(images) > 1 else 0.0
        self.rate_per_s = 1.0 / between_s if between_s > 0.0 else _FOLDER_RATE
        self.skipped: list[str] = []

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture."""
        for index in range(0, len(self._images), every):
            yield Picture(
                image=self._images[index],
                index=index,
                time_s=float(self._times_s[index]),
                name=f"picture {index}",
            )


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
        self.rate_per_s = _FOLDER_RATE
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
            time_s = index / _FOLDER_RATE if self._times_s is None else self._times_s[index]
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


class VideoSource:
    """A video file, decoded by FFmpeg.

    Args:
        path: the file.

    Raises:
        FileError: it is no video.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.name = str(path)
        self.skipped: list[str] = []
        with self._opened() as container:
            stream = container.streams.video[0]
            self.rate_per_s = float(stream.average_rate or _UNKNOWN_RATE)
            self.total: int | None = stream.frames or self._estimate(container)

    def _opened(self) -> Any:
        try:
            container = av.open(str(self._path))
        except (av.FFmpegError, OSError) as error:
            raise FileError(
                self._path, f"is no video that can be read ({_reason(error)})"
            ) from error
        if not container.streams.video:
            container.close()
            raise FileError(self._path, "holds no video")
        return container

    def _estimate(self, container: Any) -> int | None:
        if container.duration is None:
            return None
        return max(1, math.ceil(float(container.duration) / av.time_base * self.rate_per_s))

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture; damaged stretches are left out and told."""
        index, begin_s, shape = -1, None, None
        with self._opened() as container:
            for decoded in self._decoded(container):
                index += 1
                if index % every:
                    continue
                image = decoded.to_ndarray(format="rgb24")
                shape = shape or image.shape
                if image.shape != shape:
                    self.skipped.append(f"picture {index}: has another size than the first")
                    continue
                told_s = index / self.rate_per_s if decoded.time is None else float(decoded.time)
                begin_s = told_s if begin_s is None else begin_s
                yield Picture(
                    image=image, index=index, time_s=told_s - begin_s, name=f"picture {index}"
                )

    def _decoded(self, container: Any) -> Iterator[Any]:
        stream = container.streams.video[0]
        packets = container.demux(stream)
        count = damaged = 0
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    break
                count += 1
                frames = packet.decode()
            except av.FFmpegError as error:
                damaged += 1
                if damaged == 1:
                    self.skipped.append(f"packet {count}: is damaged ({_reason(error)})")
                if damaged > count:  # no packet could be read at all: the file ends here
                    break
                continue
            yield from frames
        if damaged > 1:
            self.skipped.append(f"{damaged - 1} more damaged packets")


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
        self.name = f"{_CAMERA}{number}"
        self.total: int | None = None
        self.rate_per_s = _FOLDER_RATE
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


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
