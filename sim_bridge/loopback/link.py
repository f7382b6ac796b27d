"""One client's command link: frames of ARNetwork (version 2), acknowledgements, repeats and pings.

A frame is 12 as a varint, type u8, buffer u8, sequence u16, the payload's size as a varint, and the
payload, which is any number of messages, each behind its size as u16. All little endian; a datagram
may hold several frames. Version 1 is not spoken: Olympe prefers version 2, and sends an emergency
stop only over that one.
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
        return header + varint(len(self.payload)) + self.payload

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


def _read_varint(data: bytes, offset: int) -> tuple[int, int]:
    """Return the value, -1 where it is damaged, and where it ends."""
    value = 0
    for index, byte in enumerate(data[offset : offset + _MAX_VARINT_BYTES]):
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, offset + index + 1
    return -1, offset


_BEHIND: Final = 10  # a sequence so far behind is not late: its sender has restarted


@dataclass(frozen=True, kw_only=True)
class LinkTiming:
    """When a link repeats an event, and when it is dead."""

    repeat_s: float = 0.1  # s without an acknowledgement; the SDK itself waits 0.15
    ping_s: float = 2.0  # s between two pings, as the drone does
    silence_s: float = 5.0  # s without a frame after which the client is gone, as the SDK has it


class Link:
    """Sends events and takes commands; what must be acknowledged keeps its order.

    Args:
        transmit: sends a datagram; may lose it.
        now_s: the time.
        timing: when it repeats an event, and when it is dead.
    """

    def __init__(
        self,
        transmit: Callable[[bytes], None],
        now_s: float,
        *,
        timing: LinkTiming | None = None,
    ) -> None:
        self._transmit = transmit
        self._timing = timing or LinkTiming()
        self.received_s = now_s  # when anything came from the client last
        self._pinged_s = now_s
        self._waiting: deque[bytes] = deque()
        self._in_flight: WireFrame | None = None
        self._packed = 0  # how many events are in it
        self._sent_s = now_s
        self._sequences: dict[int, int] = {}  # of what is sent, by buffer
        self._received: dict[int, int] = {}  # the last taken, by buffer

    @property
    def pending(self) -> int:
        """How many events wait for their acknowledgement."""
        return len(self._waiting) + self._packed

    def dead(self, now_s: float) -> bool:
        """Return whether the client has been silent for too long."""
        return now_s - self.received_s > self._timing.silence_s

    def send(self, payload: bytes, now_s: float, *, acked: bool) -> None:
        """Send an event, at once or, where it must be acknowledged, in its turn.

        Args:
            payload: the encoded message.
            now_s: the time.
            acked: whether it must be acknowledged.
        """
        if acked:
            self._waiting.append(payload)
            self._launch(now_s)
        else:
            self._send_frame(FrameType.DATA, EVENTS_WITHOUT_ACK, pack([payload]))

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        """Take a datagram.

        Args:
            datagram: what came; damaged frames are ignored.
            now_s: the time.

        Returns:
            The encoded commands in it that were not taken before.
        """
        commands: list[bytes] = []
        for frame in parse(datagram):
            self.received_s = now_s
            if frame.type is FrameType.ACK:
                self._acknowledged(frame, now_s)
            elif frame.buffer == PING:
                self._send_frame(FrameType.DATA, PONG, frame.payload)
            elif frame.buffer != PONG:
                if frame.type is FrameType.DATA_WITH_ACK:
                    # Also when it is a double: the first acknowledgement may have been lost.
                    ack_buffer = frame.buffer + ACK_OFFSET
                    self._send_frame(FrameType.ACK, ack_buffer, frame.acknowledgement)
                if self._is_new(frame):
                    commands += unpack(frame.payload)
        return commands

    def poll(self, now_s: float) -> None:
        """Repeat what was not acknowledged, and ping when it is time."""
        if self._in_flight is not None and now_s - self._sent_s >= self._timing.repeat_s:
            self._sent_s = now_s
            self._transmit(self._in_flight.to_bytes())
        if now_s - self._pinged_s >= self._timing.ping_s:
            self.ping(now_s)

    def ping(self, now_s: float) -> None:
        """Send a ping, which a client answers."""
        self._pinged_s = now_s
        whole = int(now_s)
        self._send_frame(
            FrameType.DATA, PING, struct.pack("<QQ", whole, int((now_s - whole) * 1e9))
        )

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
            self._packed = 0
            self._launch(now_s)

    def _launch(self, now_s: float) -> None:
        if self._in_flight is None and self._waiting:
            taken = [self._waiting.popleft()]
            while self._waiting and fits(taken, self._waiting[0]):
                taken.append(self._waiting.popleft())
            self._sent_s, self._packed = now_s, len(taken)
            payload = pack(taken)
            self._in_flight = self._send_frame(FrameType.DATA_WITH_ACK, EVENTS, payload)

    def _send_frame(self, kind: FrameType, buffer: int, payload: bytes) -> WireFrame:
        buffer %= 256
        sequence = (self._sequences.get(buffer, -1) + 1) % SEQUENCES
        self._sequences[buffer] = sequence
        frame = WireFrame(type=kind, buffer=buffer, sequence=sequence, payload=payload)
        self._transmit(frame.to_bytes())
        return frame
