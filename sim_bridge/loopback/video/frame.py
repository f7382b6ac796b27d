"""Video frame with telemetry, and its encoding as Parrot's `TimedMetadata`.

Field numbers and types are from the message descriptors in
`olympe_deps/libvideo-metadata-protobuf.so` of the wheels parrot-olympe 7.7.5 and 8.5.0. Both are
equal, except that 7.7.5 skips `altitude_ato`, `zoom_level` and `spectrum`. The layout of the RTP
header extension is that of Parrot's libvideo-streaming (`vstrm_rtp_h264.h`): a word with the
indices of the last and the present part and the padding, an offset, and the message, all big
endian.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.video import protobuf
from sim_bridge.loopback.world import LINK_QUALITY, RSSI_DBM, SATELLITES, Location
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types import Attitude, FlyingState


@dataclass(frozen=True, kw_only=True)
class NorthEastDown:
    """A vector in the frame north, east, down: metres, or metres per second."""

    north: float = 0.0
    east: float = 0.0
    down: float = 0.0


@dataclass(frozen=True, kw_only=True)
class VideoFrame:
    """One camera image with the telemetry at its capture time."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB
    captured_s: float  # capture time by the server's monotonic clock; differs for each frame
    captured_utc_s: float | None = None  # capture time since the epoch; None: unknown
    attitude: Attitude = field(default_factory=Attitude)  # body; yaw clockwise from north
    camera: Attitude = field(default_factory=Attitude)  # camera view, in the same frame
    velocity_mps: NorthEastDown = field(default_factory=NorthEastDown)
    position_m: NorthEastDown = field(default_factory=NorthEastDown)  # from the take-off point
    location: Location | None = None
    altitude_m: float = 0.0  # above the take-off point
    height_m: float = 0.0  # above the surface below
    battery: float = 1.0  # 0 to 1
    flying: FlyingState = FlyingState.LANDED
    fov_rad: tuple[float, float] = (0.0, 0.0)  # horizontal, vertical; 0: unknown

    def __post_init__(self) -> None:
        if self.image.ndim != 3 or self.image.shape[2] != 3 or 0 in self.image.shape:
            raise ShapeError("video image", expected="HxWx3", actual=self.image.shape)
        if self.image.dtype != np.uint8:
            raise ValueRangeError(f"a video image holds uint8, got {self.image.dtype}")
        if not 0.0 <= self.battery <= 1.0:
            raise ValueRangeError(f"battery must lie within 0 and 1, got {self.battery}")


class FrameSource(Protocol):
    """Source of video frames."""

    def newest(self) -> VideoFrame | None:
        """Return the newest frame; None before the first.

        Called on the video's thread, and only while a client plays. It may block, for example to
        render. A frame that was returned before is recognised by its time and not sent again.
        """


EXTENSION_ID: Final = 0x5062
MAX_METADATA_BYTES: Final = 300  # limit of Parrot's sender for one packet

_UTC_ACCURACY_US: Final = 1_000  # 0 would mean that the time is not valid
_MANUAL_PILOTING: Final = 1
_VISIBLE_SPECTRUM: Final = 1
_GOODPUT_KBITPS: Final = 20_000
_FLYING: Final = {
    FlyingState.LANDED: 0,
    FlyingState.TAKING_OFF: 1,
    FlyingState.HOVERING: 2,
    FlyingState.FLYING: 3,
    FlyingState.LANDING: 4,
    FlyingState.EMERGENCY: 5,
}


def timed_metadata(frame: VideoFrame) -> bytes:
    """Return the telemetry of a frame as an encoded `vmeta.TimedMetadata`."""
    parts = (_drone(frame), _camera(frame), protobuf.message(1, _wifi()))
    return b"".join(protobuf.message(number, part) for number, part in enumerate(parts, 1))


def extension(metadata: bytes) -> bytes:
    """Return the RTP header extension with the metadata of a frame, including its header.

    Raises:
        ValueRangeError: the metadata does not fit into one packet.
    """
    if len(metadata) > MAX_METADATA_BYTES:
        raise ValueRangeError(
            f"metadata of a frame have at most {MAX_METADATA_BYTES} bytes, got {len(metadata)}"
        )
    padding = -len(metadata) % 4
    words = 1 + (len(metadata) + padding) // 4
    # There is one part: number 0, the last one, at offset 0.
    head = struct.pack("!HHHH", EXTENSION_ID, words, padding, 0)
    return head + metadata + bytes(padding)


def quaternion(attitude: Attitude) -> tuple[float, float, float, float]:
    """Return the quaternion w, x, y, z from body to north-east-down (order yaw, pitch, roll)."""
    cr, sr = math.cos(attitude.roll_rad / 2), math.sin(attitude.roll_rad / 2)
    cp, sp = math.cos(attitude.pitch_rad / 2), math.sin(attitude.pitch_rad / 2)
    cy, sy = math.cos(attitude.yaw_rad / 2), math.sin(attitude.yaw_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _drone(frame: VideoFrame) -> bytes:
    location = b"" if frame.location is None else protobuf.message(2, _location(frame.location))
    return b"".join(
        (
            protobuf.message(1, _rotation(frame.attitude)),
            location,
            protobuf.double(3, frame.height_m),
            protobuf.message(4, _vector(frame.velocity_mps)),
            protobuf.signed(5, round(100.0 * frame.battery)),
            protobuf.unsigned(7, _FLYING[frame.flying]),
            protobuf.message(9, _vector(frame.position_m)),
            protobuf.message(10, _vector(frame.position_m)),
            protobuf.unsigned(12, _MANUAL_PILOTING),
            protobuf.double(13, frame.altitude_m),
        )
    )


def _camera(frame: VideoFrame) -> bytes:
    # The base view is the stabilised heading, without pan and tilt by a pilot.
    base = Attitude(yaw_rad=frame.attitude.yaw_rad)
    horizontal_rad, vertical_rad = frame.fov_rad
    utc = b""
    if frame.captured_utc_s is not None:
        utc = protobuf.unsigned(10, _microseconds(frame.captured_utc_s))
        utc += protobuf.unsigned(11, _UTC_ACCURACY_US)
    return b"".join(
        (
            protobuf.unsigned(1, _microseconds(frame.captured_s)),
            protobuf.message(2, _rotation(base)),
            protobuf.message(3, _rotation(frame.camera)),
            protobuf.float32(8, horizontal_rad),
            protobuf.float32(9, vertical_rad),
            utc,
            protobuf.message(15, _rotation(frame.camera)),
            protobuf.float32(16, 1.0),
            protobuf.unsigned(17, _VISIBLE_SPECTRUM),
        )
    )


def _wifi() -> bytes:
    """Return the state of a good link: goodput in kbit/s, quality from 1 to 5, dBm."""
    return b"".join(
        (
            protobuf.unsigned(1, _GOODPUT_KBITPS),
            protobuf.unsigned(2, LINK_QUALITY),
            protobuf.signed(3, RSSI_DBM),
        )
    )


def _rotation(attitude: Attitude) -> bytes:
    return b"".join(
        protobuf.float32(number, part) for number, part in enumerate(quaternion(attitude), 1)
    )


def _vector(vector: NorthEastDown) -> bytes:
    parts = (vector.north, vector.east, vector.down)
    return b"".join(protobuf.float32(number, part) for number, part in enumerate(parts, 1))


def _location(location: Location) -> bytes:
    return b"".join(
        (
            protobuf.double(1, location.latitude_deg),
            protobuf.double(2, location.longitude_deg),
            protobuf.double(3, location.altitude_m),
            protobuf.unsigned(4, SATELLITES),
        )
    )


def _microseconds(time_s: float) -> int:
    return round(1e6 * time_s)
