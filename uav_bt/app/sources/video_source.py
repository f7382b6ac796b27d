"""Video files, decoded by FFmpeg and shown as players show them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
from av.video.reformatter import Colorspace, Interpolation
from numpy.typing import NDArray

from perception.camera.image_files import UPRIGHT, Orientation
from uav_bt.app.sources.shots import ImageSource, Shot, Shots, Size
from uav_bt.display.video.video_file import FILM
from uav_bt.errors import FileError, ValueRangeError

_UNKNOWN_RATE: Final = 25.0  # of a video file that does not say
_HD_ROWS: Final = 720  # from these rows on players take untagged colours for BT.709
# Numbers of ITU-T H.273.
_UNTAGGED: Final = 2  # a matrix that the file does not state
_HDR: Final = {16: "PQ", 18: "HLG"}  # transfer characteristics


class VideoSource(ImageSource):
    """A video file, decoded by FFmpeg.

    Images are turned and widened as players do it. A cover picture is no video stream.
    Where time stamps start again, as in joined recordings, times go on.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._opened() as (container, stream):
            if container.metadata.get("comment") == FILM:
                raise FileError(
                    path,
                    "is a film that uav-bt made, of panes and text; perception wants the camera's "
                    "own video, or the record of a flight (`uav-bt fly --record`)",
                )
            rate_per_s = float(stream.average_rate or _UNKNOWN_RATE)
            stated_s = container.duration and float(container.duration) / av.time_base
            guessed = stated_s and max(1, math.ceil(stated_s * rate_per_s))
            super().__init__(str(path), stream.frames or guessed or None, rate_per_s)
            hdr = _HDR.get(int(stream.codec_context.color_trc))
            if hdr:
                self.warnings.append(
                    f"the video is HDR ({hdr}), so its colours are pale and dark; switch HDR off "
                    "in the camera and film again"
                )

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, Any]]:
        """Open the file and its first video stream."""
        try:
            # An absolute path: FFmpeg takes the part before a colon for a protocol.
            container = av.open(str(self._path.absolute()))
        except (av.FFmpegError, OSError) as error:
            raise FileError(
                self._path,
                f"is not a readable video ({_reason(error)}); copy it again from the camera, or "
                "convert it to MP4 with a video editor",
            ) from error
        with container:
            for stream in container.streams.video:
                if not stream.disposition & av.stream.Disposition.attached_pic:
                    yield container, stream
                    return
            raise FileError(self._path, "holds no video; a cover picture is none")

    def images(self, every: int = 1) -> Shots:
        """Iterate over every n-th image; damaged images are left out and counted."""
        orientation, read_from = UPRIGHT, None
        with self._opened() as (container, stream):
            wide = float(stream.sample_aspect_ratio or 1)
            for index, time_s, decoded in self._timed(container.demux(stream)):
                # Not of each image: PyAV's side data hold their image in a reference cycle, and
                # hundreds of images would wait for the garbage collector.
                if read_from != (read_from := (decoded.rotation, decoded.width, decoded.height)):
                    orientation = self._orientation(decoded)
                if index % every:
                    continue
                stored_px = (round(decoded.width * wide), decoded.height)
                yield Shot(
                    index=index,
                    time_s=time_s,
                    name=f"image {index}",
                    size_px=stored_px[::-1] if orientation.transpose else stored_px,
                    orientation=orientation,
                    pixels=partial(_converted, decoded, orientation, stored_px),
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

    def _timed(self, packets: Iterator[Any]) -> Iterator[tuple[int, float, Any]]:
        """Yield number, time since the first image in s, and each image that is whole."""
        begin_s, last_s = None, 0.0
        for index, decoded in self._decoded(packets):
            shown_s = index / self.rate_per_s if decoded.time is None else float(decoded.time)
            begin_s = shown_s if begin_s is None else begin_s
            if shown_s - begin_s < last_s:  # another recording is joined
                begin_s = shown_s - last_s - 1.0 / self.rate_per_s
            last_s = shown_s - begin_s
            yield index, last_s, decoded

    def _decoded(self, packets: Iterator[Any]) -> Iterator[tuple[int, Any]]:
        count = unreadable = damaged = 0
        suspect: set[int | None] = set()  # time stamps of packets that arrived damaged
        index, first = -1, ""
        try:
            for packet in packets:
                count += 1
                if packet.is_corrupt:
                    suspect.add(packet.pts)
                try:
                    frames = packet.decode()
                except av.FFmpegError as error:
                    unreadable += 1
                    first = first or f"packet {count}, {_reason(error)}"
                    continue
                for frame in frames:
                    index += 1
                    if frame.is_corrupt or frame.pts in suspect:
                        suspect.discard(frame.pts)
                        damaged += 1
                        first = first or f"image {index}"
                    else:
                        yield index, frame
        except av.FFmpegError as error:
            self.skipped.append(f"what follows packet {count} cannot be read: {_reason(error)}")
        finally:
            if damaged or unreadable:
                self.skipped.append(
                    f"{damaged} damaged images and {unreadable} packets that cannot be decoded; "
                    f"the first is {first}"
                )


def _converted(
    decoded: Any,
    orientation: Orientation,
    stored_px: Size,
    size_px: Size | None = None,
    *,
    colour: bool = True,
) -> NDArray[np.uint8]:
    options: dict[str, Any] = {}
    if size_px is not None or stored_px[0] != decoded.width:
        shown_px = stored_px if size_px is None else size_px
        turned = size_px is not None and orientation.transpose
        options["width"], options["height"] = shown_px[::-1] if turned else shown_px
        options["interpolation"] = Interpolation.BILINEAR
    if decoded.colorspace == _UNTAGGED and decoded.height >= _HD_ROWS:
        options["src_colorspace"] = Colorspace.ITU709
    return orientation.image(decoded.to_ndarray(format="rgb24" if colour else "gray", **options))


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
