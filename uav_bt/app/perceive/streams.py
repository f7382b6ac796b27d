"""Protocol of frame sources, and the streams among them: video files and live cameras."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import av
import cv2
import numpy as np

from perception.camera.orientation import UPRIGHT, Orientation
from uav_bt.display.video.video_file import FILM
from uav_bt.errors import FileError, InputError, ValueRangeError
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


# --- video files ----------------------------------------------------------------------------------

_UNKNOWN_RATE: Final = 25.0  # of a video file that does not say


class VideoSource:
    """A video file, decoded by FFmpeg.

    Images are turned as players turn them, by the orientation in the file. A cover picture is no
    video stream. Where time stamps start again, as in joined recordings, times go on.

    Args:
        path: the file.

    Raises:
        FileError: it is no video, or a film of ours.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.name = str(path)
        self.skipped: list[str] = []
        with self._opened() as container:
            if container.metadata.get("comment") == FILM:
                raise FileError(
                    path,
                    "is a film that uav-bt made, of panes and text; perception wants the camera's "
                    "own video, or the record of a flight (`uav-bt fly --record`)",
                )
            stream = self._stream(container)
            self.rate_per_s = float(stream.average_rate or _UNKNOWN_RATE)
            self.total: int | None = stream.frames or self._estimate(container)

    def _opened(self) -> Any:
        try:
            # An absolute path: FFmpeg takes the part before a colon for a protocol.
            container = av.open(str(self._path.absolute()))
        except (av.FFmpegError, OSError) as error:
            raise FileError(self._path, f"is not a readable video ({_reason(error)})") from error
        if not container.streams.video:
            container.close()
            raise FileError(self._path, "holds no video")
        return container

    def _stream(self, container: Any) -> Any:
        for stream in container.streams.video:
            if not stream.disposition & av.stream.Disposition.attached_pic:
                return stream
        raise FileError(self._path, "holds no video, only a cover picture")

    def _estimate(self, container: Any) -> int | None:
        if container.duration is None:
            return None
        return max(1, math.ceil(float(container.duration) / av.time_base * self.rate_per_s))

    def images(self, every: int = 1) -> TimedImages:
        """Iterate over every n-th image; damaged images are left out and counted.

        Raises:
            FileError: the orientation in the file is between the multiples of 90 degrees.
        """
        shape: tuple[int, ...] | None = None
        with self._opened() as container:
            for index, time_s, decoded in self._timed(container):
                if index % every:
                    continue
                orientation = self._orientation(decoded)
                image = orientation.image(decoded.to_ndarray(format="rgb24"))
                shape = shape or image.shape
                if image.shape != shape:
                    self.skipped.append(f"image {index}: has another size than the first")
                    continue
                yield TimedImage(
                    image=image,
                    index=index,
                    time_s=time_s,
                    name=f"image {index}",
                    orientation=orientation,
                )

    def _orientation(self, decoded: Any) -> Orientation:
        matrix = decoded.side_data.get("DISPLAYMATRIX")
        if matrix is None:
            return UPRIGHT
        numbers = np.frombuffer(bytes(matrix), dtype=np.int32).reshape(3, 3)
        try:
            return Orientation.from_display_matrix(numbers[:2, :2].astype(np.float64))
        except ValueRangeError as error:
            raise FileError(self._path, str(error)) from error

    def _timed(self, container: Any) -> Iterator[tuple[int, float, Any]]:
        """Yield number, time since the first image in s, and each image that is whole."""
        begin_s, last_s, step_s = None, 0.0, 1.0 / self.rate_per_s
        for index, decoded in self._decoded(container):
            shown_s = index / self.rate_per_s if decoded.time is None else float(decoded.time)
            begin_s = shown_s if begin_s is None else begin_s
            if shown_s - begin_s < last_s:  # another recording is joined to the last one
                begin_s = shown_s - last_s - step_s
            step_s = shown_s - begin_s - last_s or step_s
            last_s = shown_s - begin_s
            yield index, last_s, decoded

    def _decoded(self, container: Any) -> Iterator[tuple[int, Any]]:
        packets = container.demux(self._stream(container))
        count = unreadable = damaged = 0
        suspect: set[int | None] = set()  # time stamps of packets that arrived damaged
        index, first = -1, ""
        try:
            while True:
                try:
                    packet = next(packets, None)
                    if packet is None:
                        break
                    count += 1
                    if packet.is_corrupt:
                        suspect.add(packet.pts)
                    frames = packet.decode()
                except av.FFmpegError as error:
                    unreadable += 1
                    first = first or f"packet {count}, {_reason(error)}"
                    if unreadable > count:  # no packet could be read at all: the file ends here
                        break
                    continue
                for frame in frames:
                    index += 1
                    if frame.is_corrupt or frame.pts in suspect:
                        suspect.discard(frame.pts)
                        damaged += 1
                        first = first or f"image {index}"
                    else:
                        yield index, frame
        finally:
            if damaged or unreadable:
                self.skipped.append(
                    f"{damaged} damaged images and {unreadable} packets that cannot be decoded; "
                    f"the first is {first}"
                )


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


# --- live cameras ---------------------------------------------------------------------------------

CAMERA: Final = "camera:"  # before a device's number


class CameraSource:
    """A live camera, read by OpenCV. It never ends.

    Args:
        number: of the device.
        clock: tells when an image came.
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
