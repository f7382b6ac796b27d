"""Frames of ARNetwork, version 2: what a datagram is made of.

A frame is 12 as a varint, type u8, buffer u8, sequence u16, the payload's size as a varint, and the
payload, which is any number of messages, each behind its size as u16. All little endian; a datagram
may hold several frames. Version 1 is not spoken: Olympe prefers version 2, and sends an emergency
stop only over that one.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

PING: Final = 0  # buffer of pings
PONG: Final = 1  # buffer of their answers, which have the same payload
ACK_OFFSET: Final = 128  # an acknowledgement's buffer is the acknowledged one's plus this
EVENTS: Final = 126  # buffer of the drone's events that are acknowledged
EVENTS_WITHOUT_ACK: Final = 127  # and of those that are not
MAX_PACK_BYTES: Final = 1400  # of messages in a frame, so that it fits into a packet
SEQUENCES: Final = 1 << 16

_HEADER: Final = struct.Struct("<BBBH")
_MARK: Final = 12  # 10 more than the version, so that it is no type of version 1
_SIZE: Final = struct.Struct("<H")
_MAX_VARINT_BYTES: Final = 5


class FrameType(enum.IntEnum):
    """What a frame is."""

    ACK = 1
    DATA = 2
    LOW_LATENCY = 3  # taken like DATA; the ANAFI's clients do not send it
    DATA_WITH_ACK = 4


_KINDS: Final = frozenset(FrameType)


@dataclass(frozen=True, kw_only=True, slots=True)
class WireFrame:
    """One frame."""

    type: FrameType
    buffer: int  # 0 to 255
    sequence: int  # counts the frames of a buffer, modulo SEQUENCES
    payload: bytes = b""

    def to_bytes(self) -> bytes:
        """Return the frame as it goes over the wire."""
        header = _HEADER.pack(_MARK, self.type, self.buffer, self.sequence)
        return header + _varint(len(self.payload)) + self.payload

    @property
    def acknowledgement(self) -> bytes:
        """The payload that acknowledges the frame."""
        return _SIZE.pack(self.sequence)


def parse(datagram: bytes) -> Iterator[WireFrame]:
    """Yield the frames of a datagram, up to the first damaged one."""
    offset = 0
    while offset + _HEADER.size < len(datagram):
        mark, kind, buffer, sequence = _HEADER.unpack_from(datagram, offset)
        size, start = _read_varint(datagram, offset + _HEADER.size)
        end = start + size
        if mark != _MARK or kind not in _KINDS or size < 0 or end > len(datagram):
            return
        payload = datagram[start:end]
        yield WireFrame(type=FrameType(kind), buffer=buffer, sequence=sequence, payload=payload)
        offset = end


def fits(messages: Sequence[bytes], another: bytes) -> bool:
    """Return whether a frame with these messages takes another one.

    Args:
        messages: those that the frame has.
        another: the next; a frame takes any message alone.
    """
    size = sum(_SIZE.size + len(message) for message in (*messages, another))
    return not messages or size <= MAX_PACK_BYTES


def pack(messages: Sequence[bytes]) -> bytes:
    """Return messages as one payload."""
    return b"".join(_SIZE.pack(len(message)) + message for message in messages)


def unpack(payload: bytes) -> list[bytes]:
    """Return a payload's messages, up to the first damaged one."""
    messages, offset = [], 0
    while offset + _SIZE.size <= len(payload):
        (size,) = _SIZE.unpack_from(payload, offset)
        start, offset = offset + _SIZE.size, offset + _SIZE.size + size
        if offset <= len(payload):
            messages.append(payload[start:offset])
    return messages


def _varint(value: int) -> bytes:
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def _read_varint(data: bytes, offset: int) -> tuple[int, int]:
    """Return the value, -1 where it is damaged, and where it ends."""
    value = 0
    for index, byte in enumerate(data[offset : offset + _MAX_VARINT_BYTES]):
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, offset + index + 1
    return -1, offset
