"""H.264 encoder with the lowest delay of x264.

The settings are known to work with Parrot's decoder: baseline profile, no reordering,
several slices, parameter sets before every key frame. A frame is a sequence of NAL units
(ITU-T H.264, annex B).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Final

import av
import cv2
import numpy as np
from av.video.frame import PictureType
from numpy.typing import NDArray

from uav_bt.errors import MissingDependencyError, ValueRangeError

CLOCK_HZ: Final = 90_000  # clock of video timestamps in RTP
_BITRATE_BPS: Final = 5_000_000  # bit rate of the drone's live stream on a good link
_RATE_WINDOW_S: Final = 0.5  # window of the bit rate limit; a key frame exceeds it briefly
_KEY_INTERVAL_S: Final = 1.0  # the longest wait of a client that lost a packet
_SLICES: Final = 4  # slices per frame; a lost packet damages one of them
_START_CODE: Final = b"\x00\x00\x01"
_IDR, _SPS, _PPS = 5, 7, 8  # types of NAL units: slice of a key frame, parameter sets


class Encoder:
    """Encodes frames in order. It is not thread-safe.

    Args:
        size_px: width and height of the video.
        rate_hz: highest frame rate.

    Raises:
        MissingDependencyError: this build of PyAV has no x264.
        ValueRangeError: width or height is odd; colours have half the resolution.
    """

    def __init__(self, size_px: tuple[int, int], rate_hz: float) -> None:
        width, height = size_px
        if width % 2 or height % 2:
            raise ValueRangeError(f"the video's size must be even, got {width}x{height}")
        try:
            codec = av.CodecContext.create("libx264", "w")
        except av.error.FFmpegError as error:
            raise MissingDependencyError(
                "this build of PyAV has no encoder 'libx264'; install the wheel of 'av' from the "
                "package index"
            ) from error
        codec.width, codec.height = size_px
        codec.pix_fmt = "yuv420p"
        codec.time_base = Fraction(1, CLOCK_HZ)
        codec.framerate = Fraction(rate_hz).limit_denominator(1001)
        codec.gop_size = max(1, round(rate_hz * _KEY_INTERVAL_S))
        codec.bit_rate = _BITRATE_BPS
        codec.thread_count = 1  # the other core is needed elsewhere
        codec.color_range = 1  # MPEG: limited range
        codec.colorspace = 6  # SMPTE 170M, which is BT.601
        codec.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "profile": "baseline",
            "forced-idr": "1",
            "slices": str(_SLICES),
            "maxrate": str(_BITRATE_BPS),
            "bufsize": str(round(_BITRATE_BPS * _RATE_WINDOW_S)),
        }
        codec.open()
        self._codec = codec

    def encode(
        self, image: NDArray[np.uint8], captured_s: float, *, key: bool
    ) -> tuple[bytes, ...]:
        """Return a frame as NAL units.

        Args:
            image: (H, W, 3) uint8 RGB, of the size of the video.
            captured_s: capture time, s of a monotonic clock.
            key: whether to force a key frame.
        """
        # BT.601 of limited range, as OpenCV uses in both directions.
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = round(captured_s * CLOCK_HZ)
        frame.time_base = Fraction(1, CLOCK_HZ)
        frame.pict_type = PictureType.I if key else PictureType.NONE
        stream = b"".join(bytes(packet) for packet in self._codec.encode(frame))
        # A unit never ends with a zero byte; such zeros belong to the next start code.
        return tuple(unit.rstrip(b"\x00") for unit in stream.split(_START_CODE)[1:])


def nal_type(unit: bytes) -> int:
    """Return the type of a NAL unit."""
    return unit[0] & 0x1F


def is_key(nals: tuple[bytes, ...]) -> bool:
    """Return whether a frame can be decoded without other frames."""
    return any(nal_type(unit) == _IDR for unit in nals)


def parameter_sets(size_px: tuple[int, int], rate_hz: float) -> tuple[bytes, bytes]:
    """Return the sequence and the picture parameter set of all streams of this size and rate."""
    width, height = size_px
    black = np.zeros((height, width, 3), np.uint8)
    nals = Encoder(size_px, rate_hz).encode(black, 0.0, key=True)
    units = {nal_type(unit): unit for unit in nals}
    return units[_SPS], units[_PPS]
