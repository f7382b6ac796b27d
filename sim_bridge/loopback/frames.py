"""Frames of ARNetwork, protocol 1: what a datagram is made of.

A frame is type u8, buffer u8, sequence u8, size u32 (this header's seven bytes included), payload;
little endian. A datagram may hold several.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

__all__ = [
    "ACK_OFFSET",
    "EVENTS",
    "EVENTS_WITHOUT_ACK",
    "PING",
    "PONG",
    "FrameType",
    "WireFrame",
    "parse_frames",
]

_HEADER: Final = struct.Struct("<BBBI")
PING: Final = 0  # buffer of "are you there"
PONG: Final = 1  # buffer of the answer, which has the same payload
ACK_OFFSET: Final = 128  # an acknowledgement's buffer is the acknowledged one's plus this
EVENTS: Final = 126  # buffer of the drone's events that are acknowledged
EVENTS_WITHOUT_ACK: Final = 127  # and of those that are not


class FrameType(enum.IntEnum):
    """What a frame is."""

    ACK = 1
    DATA = 2
    LOW_LATENCY = 3
    DATA_WITH_ACK = 4


_KINDS: Final = frozenset(FrameType)


@dataclass(frozen=True, kw_only=True, slots=True)
class WireFrame:
    """One frame."""

    type: FrameType
    buffer: int  # 0 to 255
    sequence: int  # 0 to 255, counts the frames of a buffer
    payload: bytes = b""

    def to_bytes(self) -> bytes:
        """Return the frame as it goes over the wire."""
        size = _HEADER.size + len(self.payload)
        return _HEADER.pack(self.type, self.buffer, self.sequence, size) + self.payload


def parse_frames(datagram: bytes) -> Iterator[WireFrame]:
    """Yield the frames of a datagram, up to the first damaged one."""
    offset = 0
    while offset + _HEADER.size <= len(datagram):
        kind, buffer, sequence, size = _HEADER.unpack_from(datagram, offset)
        end = offset + size
        if size < _HEADER.size or end > len(datagram) or kind not in _KINDS:
            return
        payload = datagram[offset + _HEADER.size : end]
        yield WireFrame(type=FrameType(kind), buffer=buffer, sequence=sequence, payload=payload)
        offset = end
