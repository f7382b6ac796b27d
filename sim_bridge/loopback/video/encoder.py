"""H.264 encoder with the lowest delay of x264.

The settings are known to work with Parrot's decoder: baseline profile, no reordering,
several slices, parameter sets before every key frame. A frame is a sequence of NAL units
(ITU-T H.264, annex B).
"""

from __future__ import annotations

import fractions
from dataclasses import dataclass
from typing import Final

import av
import cv2
import numpy as np
from av.video.frame import PictureType
from numpy.typing import NDArray

from uav_bt.errors import DroneError, MissingDependencyError, ValueRangeError

CLOCK_HZ: Final = 90_000  # clock of video timestamps in RTP
IDR: Final = 5  # type of a NAL unit: slice of a key frame
_SPS: Final = 7
_PPS: Final = 8
_START_CODE: Final = b"\x00\x00\x01"
_CHROMA_PX: Final = 2  # sizes must be even, because chroma has half the resolution
_MAX_SIDE_PX: Final = 4096
_RANGES: Final = {
    "rate_hz": (0.1, 240.0),
    "bitrate_bps": (1e4, 1e9),
    "keyframe_interval_s": (1e-3, 3600.0),
    "slices": (1, 16),
    "threads": (1, 16),
}
_RATE_WINDOW_S: Final = 0.5  # window of the bit rate limit; a key frame exceeds it briefly


@dataclass(frozen=True, kw_only=True)
class EncoderConfig:
    """Parameters of the encoder.

    Raises:
        ValueRangeError: a value is out of its range.
    """

    size_px: tuple[int, int] = (1280, 720)  # width and height, as the drone
    rate_hz: float = 30.0  # highest frame rate, as the drone
    bitrate_bps: int = 5_000_000  # bit rate of the drone's live stream on a good link
    keyframe_interval_s: float = 1.0  # the longest wait of a client that lost a packet
    slices: int = 4  # slices per frame; a lost packet damages one of them
    threads: int = 1  # threads of the encoder; the other core is needed elsewhere

    def __post_init__(self) -> None:
        width, height = self.size_px
        if not all(
            side % _CHROMA_PX == 0 and 16 <= side <= _MAX_SIDE_PX for side in (width, height)
        ):
            raise ValueRangeError(
                f"width and height must be even and within 16 and {_MAX_SIDE_PX}, got "
                f"{width}x{height}"
            )
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueRangeError(f"{name} must lie within {low:g} and {high:g}, got {value}")


@dataclass(frozen=True, kw_only=True)
class EncodedFrame:
    """One frame as NAL units without start codes."""

    nals: tuple[bytes, ...]

    @property
    def is_key(self) -> bool:
        """Whether it can be decoded without other frames."""
        return any(nal_type(unit) == IDR for unit in self.nals)


class Encoder:
    """Encodes frames in order. It is not thread-safe.

    Args:
        config: size, rate and quality.

    Raises:
        MissingDependencyError: this build of PyAV has no x264.
    """

    def __init__(self, config: EncoderConfig) -> None:
        self._config = config
        self._codec = _open(config)

    def encode(
        self, image: NDArray[np.uint8], captured_s: float, *, key: bool = False
    ) -> EncodedFrame:
        """Encode a frame.

        Args:
            image: (H, W, 3) uint8 RGB; resized to the size of the video.
            captured_s: capture time, s of a monotonic clock.
            key: force a key frame.
        """
        size_px = self._config.size_px
        if image.shape[1::-1] != size_px:
            smaller = size_px[0] < image.shape[1]
            how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
            image = np.asarray(cv2.resize(image, size_px, interpolation=how), np.uint8)
        # BT.601 of limited range, as OpenCV uses in both directions.
        planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = round(captured_s * CLOCK_HZ)
        frame.time_base = fractions.Fraction(1, CLOCK_HZ)
        frame.pict_type = PictureType.I if key else PictureType.NONE
        packets = self._codec.encode(frame)
        return EncodedFrame(nals=split_nals(b"".join(bytes(packet) for packet in packets)))


def split_nals(stream: bytes) -> tuple[bytes, ...]:
    """Return the NAL units between start codes.

    A unit never ends with a zero byte; such zeros belong to the next start code.
    """
    units = (unit.rstrip(b"\x00") for unit in stream.split(_START_CODE)[1:])
    return tuple(unit for unit in units if unit)


def nal_type(unit: bytes) -> int:
    """Return the type of a NAL unit."""
    return unit[0] & 0x1F


@dataclass(frozen=True, kw_only=True)
class ParameterSets:
    """Parameter sets that a decoder needs before the first frame."""

    sps: bytes
    pps: bytes

    @property
    def profile_level_id(self) -> str:
        """Profile, constraints and level in the format of the SDP."""
        return self.sps[1:4].hex().upper()


def find_parameter_sets(nals: tuple[bytes, ...]) -> ParameterSets:
    """Return the parameter sets of a key frame.

    Raises:
        DroneError: the frame has none.
    """
    sps = next((unit for unit in nals if nal_type(unit) == _SPS), None)
    pps = next((unit for unit in nals if nal_type(unit) == _PPS), None)
    if sps is None or pps is None:
        kinds = ", ".join(str(nal_type(unit)) for unit in nals) or "none"
        raise DroneError(f"expected NAL units 7 and 8 in a key frame, got types {kinds}")
    return ParameterSets(sps=sps, pps=pps)


def parameter_sets(config: EncoderConfig) -> ParameterSets:
    """Return the parameter sets of all streams with this configuration.

    Raises:
        MissingDependencyError: this build of PyAV has no x264.
    """
    width, height = config.size_px
    first = Encoder(config).encode(np.zeros((height, width, 3), np.uint8), 0.0)
    return find_parameter_sets(first.nals)


def _open(config: EncoderConfig) -> av.VideoCodecContext:
    try:
        codec = av.CodecContext.create("libx264", "w")
    except av.error.FFmpegError as error:
        raise MissingDependencyError(
            "this build of PyAV has no encoder 'libx264'; install the wheel of 'av' from the "
            "package index"
        ) from error
    codec.width, codec.height = config.size_px
    codec.pix_fmt = "yuv420p"
    codec.time_base = fractions.Fraction(1, CLOCK_HZ)
    codec.framerate = fractions.Fraction(config.rate_hz).limit_denominator(1001)
    codec.gop_size = max(1, round(config.rate_hz * config.keyframe_interval_s))
    codec.bit_rate = config.bitrate_bps
    codec.thread_count = config.threads
    codec.color_range = 1  # MPEG: limited range
    codec.colorspace = 6  # SMPTE 170M, which is BT.601
    codec.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "profile": "baseline",
        "forced-idr": "1",
        "slices": str(config.slices),
        "maxrate": str(config.bitrate_bps),
        "bufsize": str(round(config.bitrate_bps * _RATE_WINDOW_S)),
    }
    codec.open()
    return codec
