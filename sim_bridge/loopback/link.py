"""Command link to one client: ARNetwork frames (version 2), acknowledgements, repeats, pings.

A frame is 12 as a varint, type u8, buffer u8, sequence u16, size of the payload as a varint, and
the payload: any number of messages, each preceded by its size as u16. All are little endian. A
datagram may hold several frames. Version 1 is not supported: Olympe prefers version 2 and sends an
emergency stop only with version 2.
"""

from __future__ import annotations

import enum
import struct
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.codec import varint

PING: Final = 0  # buffer of pings
PONG: Final = 1  # buffer of the answers to pings; the payload is the same
ACK_OFFSET: Final = 128  # from the buffer of a frame to that of its acknowledgement
EVENTS: Final = 126  # buffer of events with acknowledgement
EVENTS_WITHOUT_ACK: Final = 127  # buffer of events without acknowledgement
MAX_PACK_BYTES: Final = 1400  # messages in a frame, so that it fits into a packet
SEQUENCES: Final = 1 << 16
SILENCE_S: Final = 5.0  # timeout of a silent client, as in the SDK

_HEADER: Final = struct.Struct("<BBBH")
_MARK: Final = 12  # version + 10, which differs from all frame types of version 1
_SIZE: Final = struct.Struct("<H")
_MAX_VARINT_BYTES: Final = 5
_BEHIND: Final = 10  # a sequence this far behind is not late: its sender has restarted
_REPEAT_S: Final = 0.1  # time without acknowledgement until an event is repeated (SDK: 0.15), s
_PING_S: Final = 2.0  # time between two pings, as the drone, s


class FrameType(enum.IntEnum):
    """Type of a message frame of ARNetwork."""

    ACK = 1
    DATA = 2
    LOW_LATENCY = 3  # handled like DATA; clients of the ANAFI do not send it
    DATA_WITH_ACK = 4


@dataclass(frozen=True, kw_only=True, slots=True)
class WireFrame:
    """One frame."""

    type: FrameType
    buffer: int  # 0 to 255
    sequence: int  # number of the frame in its buffer, modulo SEQUENCES
    payload: bytes = b""

    def to_bytes(self) -> bytes:
        """Return the bytes of the frame."""
        header = _HEADER.pack(_MARK, self.type, self.buffer, self.sequence)
        return header + varint(len(self.payload)) + self.payload

    @property
    def acknowledgement(self) -> bytes:
        """The payload that acknowledges the frame."""
        return _SIZE.pack(self.sequence)


def parse(datagram: bytes) -> Iterator[WireFrame]:
    """Yield the frames of a datagram up to the first damaged one."""
    offset = 0
    while offset + _HEADER.size < len(datagram):
        mark, kind, buffer, sequence = _HEADER.unpack_from(datagram, offset)
        size, start = _read_varint(datagram, offset + _HEADER.size)
        offset = start + size
        known = mark == _MARK and kind in set(FrameType)
        if not known or size < 0 or offset > len(datagram):
            return
        payload = datagram[start:offset]
        yield WireFrame(type=FrameType(kind), buffer=buffer, sequence=sequence, payload=payload)


def pack(messages: Sequence[bytes]) -> bytes:
    """Return one payload that holds the messages."""
    return b"".join(_SIZE.pack(len(message)) + message for message in messages)


def unpack(payload: bytes) -> list[bytes]:
    """Return the messages of a payload up to the first damaged one."""
    messages, offset = [], 0
    while offset + _SIZE.size <= len(payload):
        (size,) = _SIZE.unpack_from(payload, offset)
        start, offset = offset + _SIZE.size, offset + _SIZE.size + size
        if offset <= len(payload):
            messages.append(payload[start:offset])
    return messages


def _read_varint(data: bytes, offset: int) -> tuple[int, int]:
    """Return the value (-1 if damaged) and the offset of its end."""
    value = 0
    for index, byte in enumerate(data[offset : offset + _MAX_VARINT_BYTES]):
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, offset + index + 1
    return -1, offset


class Link:
    """Sends events and receives commands; events with acknowledgement keep their order."""

    def __init__(self, transmit: Callable[[bytes], None], now_s: float) -> None:
        self._transmit = transmit
        self._received_s = now_s  # time of the last frame from the client
        self._pinged_s = now_s
        self._waiting: deque[bytes] = deque()
        self._in_flight: WireFrame | None = None  # events without acknowledgement so far
        self._sent_s = now_s
        self._sequences: dict[int, int] = {}  # last sequence sent, by buffer
        self._received: dict[int, int] = {}  # last sequence accepted, by buffer

    def dead(self, now_s: float) -> bool:
        """Return whether the link has timed out."""
        return now_s - self._received_s > SILENCE_S

    def send(self, payload: bytes, now_s: float, *, acked: bool) -> None:
        """Send an event: at once, or after the earlier ones if it must be acknowledged."""
        if acked:
            self._waiting.append(payload)
            self._launch(now_s)
        else:
            self._send_frame(FrameType.DATA, EVENTS_WITHOUT_ACK, pack([payload]))

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        """Process a datagram; return its commands without those that were received before."""
        commands: list[bytes] = []
        for frame in parse(datagram):
            self._received_s = now_s
            if frame.type is FrameType.ACK:
                self._acknowledged(frame, now_s)
            elif frame.buffer == PING:
                self._send_frame(FrameType.DATA, PONG, frame.payload)
            elif frame.buffer != PONG:
                if frame.type is FrameType.DATA_WITH_ACK:
                    # Duplicates, too: the first acknowledgement may have been lost.
                    ack_buffer = frame.buffer + ACK_OFFSET
                    self._send_frame(FrameType.ACK, ack_buffer, frame.acknowledgement)
                if self._is_new(frame):
                    commands += unpack(frame.payload)
        return commands

    def poll(self, now_s: float) -> None:
        """Repeat events that were not acknowledged; ping when due."""
        if self._in_flight is not None and now_s - self._sent_s >= _REPEAT_S:
            self._sent_s = now_s
            self._transmit(self._in_flight.to_bytes())
        if now_s - self._pinged_s >= _PING_S:
            self.ping(now_s)

    def ping(self, now_s: float) -> None:
        """Send a ping, which the client answers."""
        self._pinged_s = now_s
        seconds, nanoseconds = divmod(int(now_s * 1e9), 1_000_000_000)
        self._send_frame(FrameType.DATA, PING, struct.pack("<QQ", seconds, nanoseconds))

    def _is_new(self, frame: WireFrame) -> bool:
        last = self._received.get(frame.buffer)
        if last is not None:
            half = SEQUENCES // 2
            ahead = (frame.sequence - last + half) % SEQUENCES - half
            if -_BEHIND < ahead <= 0:
                return False
        self._received[frame.buffer] = frame.sequence
        return True

    def _acknowledged(self, frame: WireFrame, now_s: float) -> None:
        ours = self._in_flight
        if ours is None or frame.buffer != ours.buffer + ACK_OFFSET:
            return
        if frame.payload == ours.acknowledgement:
            self._in_flight = None
            self._launch(now_s)

    def _launch(self, now_s: float) -> None:
        if self._in_flight is None and self._waiting:
            taken = [self._waiting.popleft()]
            while self._waiting and len(pack([*taken, self._waiting[0]])) <= MAX_PACK_BYTES:
                taken.append(self._waiting.popleft())
            self._sent_s = now_s
            self._in_flight = self._send_frame(FrameType.DATA_WITH_ACK, EVENTS, pack(taken))

    def _send_frame(self, kind: FrameType, buffer: int, payload: bytes) -> WireFrame:
        buffer %= 256
        sequence = (self._sequences.get(buffer, -1) + 1) % SEQUENCES
        self._sequences[buffer] = sequence
        frame = WireFrame(type=kind, buffer=buffer, sequence=sequence, payload=payload)
        self._transmit(frame.to_bytes())
        return frame
