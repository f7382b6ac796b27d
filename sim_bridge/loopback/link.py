"""One client's command link: acknowledgements, repeats, doubles and pings; time comes in."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback import frames
from sim_bridge.loopback.frames import (
    ACK_OFFSET,
    EVENTS,
    EVENTS_WITHOUT_ACK,
    PING,
    PONG,
    SEQUENCES,
    FrameType,
    WireFrame,
)

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
        self._received_s = now_s
        self._pinged_s = now_s
        self._waiting: deque[bytes] = deque()
        self._in_flight: WireFrame | None = None
        self._packed = 0  # how many events are in it
        self._sent_s = now_s
        self._sequences: dict[int, int] = {}  # of what is sent, by buffer
        self._received: dict[int, int] = {}  # the last taken, by buffer

    @property
    def received_s(self) -> float:
        """When anything came from the client last, s."""
        return self._received_s

    @property
    def pending(self) -> int:
        """How many events wait for their acknowledgement."""
        return len(self._waiting) + self._packed

    def dead(self, now_s: float) -> bool:
        """Return whether the client has been silent for too long."""
        return now_s - self._received_s > self._timing.silence_s

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
            self._send_frame(FrameType.DATA, EVENTS_WITHOUT_ACK, frames.pack([payload]))

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        """Take a datagram.

        Args:
            datagram: what came; damaged frames are ignored.
            now_s: the time.

        Returns:
            The encoded commands in it that were not taken before.
        """
        commands: list[bytes] = []
        for frame in frames.parse(datagram):
            self._received_s = now_s
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
                    commands += frames.unpack(frame.payload)
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
            pack = [self._waiting.popleft()]
            while self._waiting and frames.fits(pack, self._waiting[0]):
                pack.append(self._waiting.popleft())
            self._sent_s, self._packed = now_s, len(pack)
            payload = frames.pack(pack)
            self._in_flight = self._send_frame(FrameType.DATA_WITH_ACK, EVENTS, payload)

    def _send_frame(self, kind: FrameType, buffer: int, payload: bytes) -> WireFrame:
        buffer %= 256
        sequence = (self._sequences.get(buffer, -1) + 1) % SEQUENCES
        self._sequences[buffer] = sequence
        frame = WireFrame(type=kind, buffer=buffer, sequence=sequence, payload=payload)
        self._transmit(frame.to_bytes())
        return frame
