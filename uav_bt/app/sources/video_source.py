"""Video files, decoded by FFmpeg and turned as players turn them."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
from av.video.reformatter import Interpolation
from numpy.typing import NDArray

from perception.camera.image_files import UPRIGHT, Orientation
from uav_bt.app.sources.streams import TimedImage, TimedImages
from uav_bt.display.video.video_file import FILM
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.types.arrays import Image

_UNKNOWN_RATE: Final = 25.0  # of a video file that does not say


@dataclass(frozen=True, kw_only=True, eq=False)
class DecodedImage:
    """One image of a video, converted to an array on demand."""

    decoded: Any  # av.VideoFrame
    index: int  # counts all whole and damaged images of the video
    time_s: float  # since the video began
    orientation: Orientation = UPRIGHT  # from the stored image to the shown one

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the shown image."""
        width_px, height_px = self.decoded.width, self.decoded.height
        return (height_px, width_px) if self.orientation.transpose else (width_px, height_px)

    def image(self) -> Image:
        """Return the image as it is shown, (H, W, 3) uint8 RGB."""
        return self.orientation.image(self.decoded.to_ndarray(format="rgb24"))

    def shrunk(self, size_px: tuple[int, int], *, colour: bool) -> NDArray[np.uint8]:
        """Return the image as it is shown at another size.

        Args:
            size_px: Width and height.
            colour: Whether to return three colours; otherwise grey.

        Returns:
            (H, W, 3) uint8 RGB or (H, W) uint8.
        """
        width_px, height_px = size_px[::-1] if self.orientation.transpose else size_px
        small = self.decoded.to_ndarray(
            format="rgb24" if colour else "gray",
            width=width_px,
            height=height_px,
            interpolation=Interpolation.BILINEAR,
        )
        return self.orientation.image(small)


DecodedImages = Generator[DecodedImage, None, None]
"""Images in order of time; closing lets go of the file."""


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
            raise FileError(
                self._path,
                f"is not a readable video ({_reason(error)}); copy it again from the camera, or "
                "convert it to MP4 with a video editor",
            ) from error
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
        with closing(self.decoded()) as decoded:
            for one in decoded:
                if one.index % every:
                    continue
                image = one.image()
                shape = shape or image.shape
                if image.shape != shape:
                    self.skipped.append(f"image {one.index}: has another size than the first")
                    continue
                yield TimedImage(
                    image=image,
                    index=one.index,
                    time_s=one.time_s,
                    name=f"image {one.index}",
                    orientation=one.orientation,
                )

    def decoded(self) -> DecodedImages:
        """Iterate over all images without a conversion; damaged images are left out and counted.

        Raises:
            FileError: the orientation in the file is between the multiples of 90 degrees.
        """
        orientation, read_from = UPRIGHT, None
        with self._opened() as container:
            for index, time_s, decoded in self._timed(container):
                # Not of each image: PyAV's side data hold their image in a reference cycle, and
                # hundreds of images would wait for the garbage collector.
                if read_from != (read_from := (decoded.rotation, decoded.width, decoded.height)):
                    orientation = self._orientation(decoded)
                yield DecodedImage(
                    decoded=decoded, index=index, time_s=time_s, orientation=orientation
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
