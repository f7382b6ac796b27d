"""Writer of an mp4 file that appears complete or not at all."""

from __future__ import annotations

import functools
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from uav_bt.errors import FileError, MissingDependencyError, ShapeError, ValueRangeError
from uav_bt.files import writing
from uav_bt.types.arrays import Image

# H.264 plays everywhere; MPEG-4 part 2 is in every build of FFmpeg. The options favour speed over
# size, because images are encoded between the ticks of a flight.
_CODECS: Final[tuple[tuple[str, dict[str, str]], ...]] = (
    ("libx264", {"preset": "ultrafast", "crf": "28"}),
    ("mpeg4", {"qscale": "4"}),
)
FILM: Final = "a film of uav-bt, and no camera's video"
"""Comment in the metadata of films, so that perception does not use them as camera video."""

_BT601: Final = 6  # FFmpeg's AVCOL_SPC_SMPTE170M, the result of OpenCV's conversion
_LIMITED_RANGE: Final = 1  # FFmpeg's AVCOL_RANGE_MPEG


@functools.cache
def _pyav() -> Any:
    """Return PyAV. Its import takes 0.05 s, which a flight without a film need not wait for."""
    import av  # noqa: PLC0415

    return av


@functools.cache
def choose_codec(names: tuple[str, ...] = tuple(name for name, _ in _CODECS)) -> str:
    """Return the first encoder that works.

    Raises:
        MissingDependencyError: no encoder works.
    """
    for name in names:
        try:
            probe: Any = _pyav().CodecContext.create(name, "w")
            probe.width, probe.height, probe.pix_fmt = 64, 64, "yuv420p"
            probe.time_base = Fraction(1, 25)
            probe.open()
        except (_pyav().FFmpegError, ValueError):  # missing in this build, or unable to start
            continue
        return name
    raise MissingDependencyError(
        f"no video encoder works here (tried {', '.join(names)}); PyAV's wheel contains them: "
        "pip install --force-reinstall av"
    )


class VideoFile:
    """Writes images of one size into an mp4 file.

    The images are written to `<name>.part`; closing renames it. A file without images is removed.

    Args:
        path: path that ends in .mp4; an existing file is replaced by the complete new one.
        size_px: width and height, even numbers.
        frames_per_s: frame rate of the file.
        comment: comment in the metadata.

    Raises:
        FileError: the file cannot be written; it is removed.
        MissingDependencyError: no encoder works.
        ValueRangeError: the size is odd or the rate not positive.
    """

    def __init__(
        self,
        path: Path,
        *,
        size_px: tuple[int, int],
        frames_per_s: Fraction,
        comment: str = "",
    ) -> None:
        if min(size_px) <= 0 or size_px[0] % 2 or size_px[1] % 2:
            raise ValueRangeError(f"a video's width and height must be even, got {size_px}")
        if frames_per_s <= 0:
            raise ValueRangeError(f"a video needs a positive frame rate, got {frames_per_s}")
        if path.suffix.lower() != ".mp4":
            raise FileError(path, "a video's name must end in .mp4")
        if path.is_dir():
            raise FileError(path, "is a folder; name a file in it")
        codec = choose_codec()
        self.path = path
        self.codec = codec
        self.images = 0  # number of written images
        self._partial = path.with_name(path.name + ".part")
        self._size_px = size_px
        self._time_base = 1 / frames_per_s
        self._last_slot = -1
        self._failed = False
        with writing(path):  # FFmpeg's errors are OSErrors, too
            self._partial.touch()  # the system's error for a bad folder is clearer than FFmpeg's
            try:
                self._container: Any = _pyav().open(
                    str(self._partial), "w", format="mp4", options={"movflags": "+faststart"}
                )
            except OSError:
                self._partial.unlink()
                raise
        self._container.metadata["comment"] = comment
        stream: Any = self._container.add_stream(
            codec, rate=frames_per_s, options=dict(_CODECS)[codec]
        )
        stream.width, stream.height, stream.pix_fmt = *size_px, "yuv420p"
        stream.codec_context.colorspace = _BT601
        stream.codec_context.color_range = _LIMITED_RANGE
        self._stream = stream

    def write(self, image: Image, slot: int | None = None) -> None:
        """Append an image.

        Args:
            image: (H, W, 3) uint8 RGB, at the size of the video.
            slot: time of the image in frames from the start; the image before fills a gap. Default:
                the next frame.

        Raises:
            ShapeError: the image has another size.
            FileError: the file cannot be written (a full disk); it is then discarded.
            ValueRangeError: the slot is not later than the last one.
        """
        width_px, height_px = self._size_px
        if image.shape != (height_px, width_px, 3):
            raise ShapeError("image", expected=f"{height_px}x{width_px}x3", actual=image.shape)
        slot = self._last_slot + 1 if slot is None else slot
        if slot <= self._last_slot:
            raise ValueRangeError(f"images come in order: slot {slot} after {self._last_slot}")
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        frame: Any = _pyav().VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = slot, self._time_base
        self._encode(frame)
        self._last_slot = slot
        self.images += 1

    def _encode(self, frame: object) -> None:
        self._failed = True
        with writing(self.path):
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        self._failed = False

    def discard(self) -> None:
        """Discard the file; an earlier one is kept."""
        self._failed = True

    def close(self) -> None:
        """Finish and rename the file; safe to call twice.

        Raises:
            FileError: the file could not be written completely; it is removed.
        """
        if self._container is None:
            return
        try:
            if self.images and not self._failed:
                self._encode(None)
            with writing(self.path):
                self._container.close()
                if self.images and not self._failed:
                    self._partial.replace(self.path)
        finally:
            self._container = None
            self._partial.unlink(missing_ok=True)
