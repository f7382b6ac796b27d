"""Writer of an mp4 file that appears complete or not at all."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from uav_bt.display.canvas import Size
from uav_bt.errors import FileError, MissingDependencyError
from uav_bt.files import check_output, writing
from uav_bt.types.arrays import Image

_CODEC: Final = "libx264"  # H.264 plays everywhere
# Speed over size, because images are encoded between the ticks of a flight.
_OPTIONS: Final = {"preset": "ultrafast", "crf": "28"}
FILM: Final = "a film of uav-bt, and no camera's video"
"""Comment in the metadata of films, so that perception does not use them as camera video."""

_BT601: Final = 6  # FFmpeg's AVCOL_SPC_SMPTE170M, the result of OpenCV's conversion
_LIMITED_RANGE: Final = 1  # FFmpeg's AVCOL_RANGE_MPEG


class VideoFile:
    """Writes images of one size, width and height even, into an mp4 file.

    The images are written to `<name>.part`; closing renames it. A file without images is removed.
    What cannot be written raises a `FileError`, again in closing, and the file is removed.
    """

    def __init__(
        self, path: Path, *, size_px: Size, frames_per_s: Fraction, comment: str = ""
    ) -> None:
        import av  # noqa: PLC0415  (0.05 s, which a flight without a film need not wait for)

        if path.suffix.lower() != ".mp4":
            raise FileError(path, "a video's name must end in .mp4")
        check_output(path)
        try:
            av.Codec(_CODEC, "w")
        except ValueError as error:
            raise MissingDependencyError(
                "PyAV has no encoder of H.264 here; its wheel has one: "
                "pip install --force-reinstall av"
            ) from error
        self.path = path
        self._kept = False  # whether there is an image
        self._failure: FileError | None = None  # the first one
        self._partial = path.with_name(path.name + ".part")
        self.frames_per_s = frames_per_s
        self._slot = -1  # of the last image
        self._new_frame: Any = av.VideoFrame.from_ndarray
        with writing(path):  # FFmpeg's errors are OSErrors, too
            self._container: Any = av.open(
                str(self._partial), "w", format="mp4", options={"movflags": "+faststart"}
            )
        self._container.metadata["comment"] = comment
        stream: Any = self._container.add_stream(_CODEC, rate=frames_per_s, options=_OPTIONS)
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        stream.codec_context.colorspace = _BT601
        stream.codec_context.color_range = _LIMITED_RANGE
        self._stream = stream

    def write(self, image: Image, slot: int | None = None) -> None:
        """Append an image at a later slot, which counts frames."""
        if self._failure is not None:
            raise self._failure
        self._slot = self._slot + 1 if slot is None else slot
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        frame = self._new_frame(planes, format="yuv420p")
        frame.pts = self._slot
        frame.time_base = 1 / self.frames_per_s
        self._encode(frame)
        self._kept = True

    def _encode(self, frame: object) -> None:
        try:
            with writing(self.path):
                for packet in self._stream.encode(frame):
                    self._container.mux(packet)
        except FileError as error:
            self._failure = error
            raise

    def discard(self) -> None:
        """Discard the file; an earlier one is kept."""
        self._kept = False

    def close(self) -> None:
        """Finish and rename the file, or raise the first failure; safe to call twice."""
        if self._container is None:
            return
        kept = self._kept and self._failure is None
        try:
            if kept:
                self._encode(None)
            with writing(self.path):
                self._container.close()
                if kept:
                    self._partial.replace(self.path)
        finally:
            self._container = None
            self._partial.unlink(missing_ok=True)
        if self._failure is not None:
            raise self._failure
