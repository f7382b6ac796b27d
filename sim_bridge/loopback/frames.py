"""Frames of ARNetwork: what a datagram is made of, in the two versions that clients speak.

Version 1: type u8, buffer u8, sequence u8, size u32 (this header's seven bytes included), payload;
a payload is one message. Version 2: 12 as a varint, type u8, buffer u8, sequence u16, payload's
size as a varint, payload; a payload is any number of messages, each behind its size as u16. All
little endian; a datagram may hold several frames. Olympe sends an emergency stop only over version
2: for version 1 its library finds no buffer of the kind that command asks for.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

__all__ = [
    "ACK_OFFSET",
    "EVENTS",
    "EVENTS_WITHOUT_ACK",
    "MAX_PACK_BYTES",
    "PING",
    "PONG",
    "VERSION_1",
    "VERSION_2",
    "FrameType",
    "Framing",
    "WireFrame",
]

PING: Final = 0  # buffer of pings
PONG: Final = 1  # buffer of its answer, which has the same payload
ACK_OFFSET: Final = 128  # an acknowledgement's buffer is the acknowledged one's plus this
EVENTS: Final = 126  # buffer of the drone's events that are acknowledged
EVENTS_WITHOUT_ACK: Final = 127  # and of those that are not
MAX_PACK_BYTES: Final = 1400  # of messages in a frame, so that it fits into a packet

_OLD_HEADER: Final = struct.Struct("<BBBI")
_NEW_HEADER: Final = struct.Struct("<BBBH")
_MARK: Final = 12  # version 2, offset by what a type of version 1 may be
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
    sequence: int  # counts the frames of a buffer, and begins anew after the framing's last
    payload: bytes = b""


class Framing(Protocol):
    """One version of the frames."""

    @property
    def sequences(self) -> int:
        """How many sequence numbers there are."""
        ...

    def to_bytes(self, frame: WireFrame) -> bytes:
        """Return a frame as it goes over the wire."""
        ...

    def parse(self, datagram: bytes) -> Iterator[WireFrame]:
        """Yield the frames of a datagram, up to the first damaged one."""
        ...

    def sequence_bytes(self, sequence: int) -> bytes:
        """Return the payload that acknowledges a sequence."""
        ...

    def fits(self, messages: Sequence[bytes], another: bytes) -> bool:
        """Return whether a frame with these messages takes another one."""
        ...

    def pack(self, messages: Sequence[bytes]) -> bytes:
        """Return messages as one payload."""
        ...

    def unpack(self, payload: bytes) -> list[bytes]:
        """Return a payload's messages, up to the first damaged one."""
        ...


class _Version1:
    sequences = 1 << 8

    def to_bytes(self, frame: WireFrame) -> bytes:
        size = _OLD_HEADER.size + len(frame.payload)
        return _OLD_HEADER.pack(frame.type, frame.buffer, frame.sequence, size) + frame.payload

    def parse(self, datagram: bytes) -> Iterator[WireFrame]:
        offset = 0
        while offset + _OLD_HEADER.size <= len(datagram):
            kind, buffer, sequence, size = _OLD_HEADER.unpack_from(datagram, offset)
            end = offset + size
            if size < _OLD_HEADER.size or end > len(datagram) or kind not in _KINDS:
                return
            payload = datagram[offset + _OLD_HEADER.size : end]
            yield WireFrame(type=FrameType(kind), buffer=buffer, sequence=sequence, payload=payload)
            offset = end

    def sequence_bytes(self, sequence: int) -> bytes:
        return bytes([sequence])

    def fits(self, messages: Sequence[bytes], another: bytes) -> bool:
        del another
        return not messages

    def pack(self, messages: Sequence[bytes]) -> bytes:
        return b"".join(messages)

    def unpack(self, payload: bytes) -> list[bytes]:
        return [payload]


class _Version2:
    sequences = 1 << 16

    def to_bytes(self, frame: WireFrame) -> bytes:
        header = _NEW_HEADER.pack(_MARK, frame.type, frame.buffer, frame.sequence)
        return header + _varint(len(frame.payload)) + frame.payload

    def parse(self, datagram: bytes) -> Iterator[WireFrame]:
        offset = 0
        while offset + _NEW_HEADER.size < len(datagram):
            mark, kind, buffer, sequence = _NEW_HEADER.unpack_from(datagram, offset)
            size, start = _read_varint(datagram, offset + _NEW_HEADER.size)
            end = start + size
            if mark != _MARK or kind not in _KINDS or size < 0 or end > len(datagram):
                return
            yield WireFrame(
                type=FrameType(kind),
                buffer=buffer,
                sequence=sequence,
                payload=datagram[start:end],
            )
            offset = end

    def sequence_bytes(self, sequence: int) -> bytes:
        return _SIZE.pack(sequence)

    def fits(self, messages: Sequence[bytes], another: bytes) -> bool:
        size = sum(_SIZE.size + len(message) for message in (*messages, another))
        return not messages or size <= MAX_PACK_BYTES

    def pack(self, messages: Sequence[bytes]) -> bytes:
        return b"".join(_SIZE.pack(len(message)) + message for message in messages)

    def unpack(self, payload: bytes) -> list[bytes]:
        messages, offset = [], 0
        while offset + _SIZE.size <= len(payload):
            (size,) = _SIZE.unpack_from(payload, offset)
            start, offset = offset + _SIZE.size, offset + _SIZE.size + size
            if offset <= len(payload):
                messages.append(payload[start:offset])
        return messages


VERSION_1: Final[Framing] = _Version1()
VERSION_2: Final[Framing] = _Version2()


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
