"""Video frame with telemetry, and its telemetry as Parrot's `TimedMetadata`, a protobuf message.

Field numbers and types are from the message descriptors in
`olympe_deps/libvideo-metadata-protobuf.so` of the wheels parrot-olympe 7.7.5 and 8.5.0. Both are
equal, except that 7.7.5 skips `altitude_ato`, `zoom_level` and `spectrum`. As in proto3, a field of
value zero is omitted; a nested message is written even if empty, because its presence is
information.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.codec import varint
from sim_bridge.loopback.world import LINK_QUALITY, RSSI_DBM, SATELLITES, Location
from uav_bt.types import Attitude, FlyingState


class NorthEastDown(NamedTuple):
    """A vector in the frame north, east, down: metres, or metres per second."""

    north: float
    east: float
    down: float


@dataclass(frozen=True, kw_only=True)
class VideoFrame:
    """One camera image with the telemetry at its capture time."""

    image: NDArray[np.uint8]  # (H, W, 3), RGB
    captured_s: float  # capture time by the server's monotonic clock; differs for each frame
    captured_utc_s: float  # capture time since the epoch
    attitude: Attitude  # body; yaw clockwise from north
    camera: Attitude  # camera view, in the same frame
    velocity_mps: NorthEastDown
    position_m: NorthEastDown  # from the take-off point
    location: Location | None
    altitude_m: float  # above the take-off point
    height_m: float  # above the surface below
    battery: float  # 0 to 1
    flying: FlyingState
    fov_rad: tuple[float, float]  # horizontal, vertical


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
    links = (_message(1, _wifi()),)
    return _message(1, _drone(frame)) + _message(2, _camera(frame)) + _message(3, links)


def _quaternion(attitude: Attitude) -> tuple[float, float, float, float]:
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


def _drone(frame: VideoFrame) -> Iterator[bytes]:
    yield _message(1, _floats(_quaternion(frame.attitude)))
    if frame.location is not None:
        yield _message(2, _location(frame.location))
    yield _double(3, frame.height_m)
    yield _message(4, _floats(frame.velocity_mps))
    yield _signed(5, round(100.0 * frame.battery))
    yield _unsigned(7, _FLYING[frame.flying])
    yield _message(9, _floats(frame.position_m))
    yield _message(10, _floats(frame.position_m))
    yield _unsigned(12, _MANUAL_PILOTING)
    yield _double(13, frame.altitude_m)


def _camera(frame: VideoFrame) -> Iterator[bytes]:
    # The base view is the stabilised heading, without pan and tilt by a pilot.
    base = Attitude(yaw_rad=frame.attitude.yaw_rad)
    horizontal_rad, vertical_rad = frame.fov_rad
    yield _unsigned(1, round(1e6 * frame.captured_s))
    yield _message(2, _floats(_quaternion(base)))
    yield _message(3, _floats(_quaternion(frame.camera)))
    yield _float(8, horizontal_rad)
    yield _float(9, vertical_rad)
    yield _unsigned(10, round(1e6 * frame.captured_utc_s))
    yield _unsigned(11, _UTC_ACCURACY_US)
    yield _message(15, _floats(_quaternion(frame.camera)))
    yield _float(16, 1.0)
    yield _unsigned(17, _VISIBLE_SPECTRUM)


def _wifi() -> Iterator[bytes]:
    """Yield the state of a good link: goodput in kbit/s, quality from 1 to 5, dBm."""
    yield _unsigned(1, _GOODPUT_KBITPS)
    yield _unsigned(2, LINK_QUALITY)
    yield _signed(3, RSSI_DBM)


def _location(location: Location) -> Iterator[bytes]:
    yield _double(1, location.latitude_deg)
    yield _double(2, location.longitude_deg)
    yield _double(3, location.altitude_m)
    yield _unsigned(4, SATELLITES)


# Fields by number, in protobuf's wire format: varint 0, 64 bits 1, bytes with length 2, 32 bits 5.
def _unsigned(number: int, value: int) -> bytes:
    return varint(number << 3) + varint(value) if value else b""


def _signed(number: int, value: int) -> bytes:
    return _unsigned(number, value << 1 if value >= 0 else (-value << 1) - 1)


def _double(number: int, value: float) -> bytes:
    return varint(number << 3 | 1) + struct.pack("<d", value) if value else b""


def _float(number: int, value: float) -> bytes:
    return varint(number << 3 | 5) + struct.pack("<f", value) if value else b""


def _floats(values: Iterable[float]) -> Iterator[bytes]:
    return (_float(number, value) for number, value in enumerate(values, 1))


def _message(number: int, fields: Iterable[bytes]) -> bytes:
    content = b"".join(fields)
    return varint(number << 3 | 2) + varint(len(content)) + content
