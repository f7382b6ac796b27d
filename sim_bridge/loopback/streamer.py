"""Streamer: encodes the newest frame once and sends it to all playing clients."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, Protocol

from sim_bridge.loopback.encoder import Encoder
from sim_bridge.loopback.metadata import VideoFrame, timed_metadata
from sim_bridge.loopback.rtp import FramePackets, RtpStream, packetize

_LOG: Final = logging.getLogger(__name__)

# As in Parrot's sender; its receivers compute the capture time from the second report on.
_REPORT_INTERVAL_S: Final = 0.1
_POLL_S: Final = 0.004  # polling period for a new frame; half of it adds to the latency
_RATE_FRAMES: Final = 60  # number of frames for the mean rate


class Sink(Protocol):
    """Destination of a client's packets: two UDP ports, or two channels of its connection."""

    @property
    def congested(self) -> bool:
        """Whether too much data is waiting to add more."""

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""


class Player:
    """Stream to one client.

    Args:
        serial: serial number of the drone, the sender.
        sink: sends the packets.
    """

    def __init__(self, serial: str, sink: Sink) -> None:
        self.stream = RtpStream(serial)
        self._sink = sink
        self.needs_key = True  # whether the client can only decode from the next key frame on
        self._reported_s = float("-inf")

    @property
    def wants_key(self) -> bool:
        """Whether the client needs a key frame and is not congested."""
        return self.needs_key and not self._sink.congested

    def send(self, frame: FramePackets, now_s: float) -> None:
        """Send a frame unless the client is too slow or cannot decode it.

        Args:
            frame: the frame as packets.
            now_s: present time by the monotonic clock, s.
        """
        if self._sink.congested:
            self.needs_key = True
            return
        if self.needs_key and not frame.is_key:
            return
        self.needs_key = False
        if now_s - self._reported_s >= _REPORT_INTERVAL_S:
            self._reported_s = now_s
            self._sink.send_control(self.stream.report(now_s))
        self._sink.send_data(self.stream.packets(frame))

    def goodbye(self, now_s: float) -> None:
        """Send the client a BYE packet."""
        self._sink.send_control(self.stream.goodbye(now_s))


@dataclass(frozen=True, kw_only=True)
class VideoStats:
    """Statistics of the video since its start."""

    frames_encoded: int
    frames_late: int  # frame slots that passed while another frame was being made
    rate_hz: float  # mean rate of recent frames; 0 before the second frame


class Streamer:
    """Fetches, encodes and sends frames while clients play.

    Args:
        newest: returns the newest frame, or None before the first. It is called on a thread of its
            own and may block, for example to render. A frame that it returned before is recognised
            by its time and not sent again.
        size_px: width and height of the video.
        rate_hz: highest frame rate.
        now: monotonic clock of the capture times, s.
        finish: called once, at the end, on the thread of `newest`.
    """

    def __init__(
        self,
        newest: Callable[[], VideoFrame | None],
        *,
        size_px: tuple[int, int],
        rate_hz: float,
        now: Callable[[], float],
        finish: Callable[[], None] | None = None,
    ) -> None:
        self._newest = newest
        self._size_px = size_px
        self._rate_hz = rate_hz
        self._now = now
        self._finish = finish
        self._players: list[Player] = []
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="loopback-video")
        self._task: asyncio.Task[None] | None = None
        self._encoded = self._late = 0
        self._sent_s: deque[float] = deque(maxlen=_RATE_FRAMES)
        self.fault: Exception | None = None  # the error that ended the video

    def add(self, player: Player) -> None:
        """Add a client; a key frame is made for it."""
        if player in self._players:
            return
        player.needs_key = True
        self._players.append(player)
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())

    def remove(self, player: Player) -> None:
        """Remove a client; no effect if it does not play."""
        if player in self._players:
            self._players.remove(player)

    def stats(self) -> VideoStats:
        """Return the statistics since the start."""
        sent_s = self._sent_s
        rate_hz = (len(sent_s) - 1) / (sent_s[-1] - sent_s[0]) if len(sent_s) > 1 else 0.0
        return VideoStats(frames_encoded=self._encoded, frames_late=self._late, rate_hz=rate_hz)

    async def close(self) -> None:
        """Stop after the frame in progress; safe to call twice."""
        self._players.clear()
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task])
        finish, self._finish = self._finish, None
        if finish is not None:
            await asyncio.get_running_loop().run_in_executor(self._thread, finish)
        self._thread.shutdown()

    async def _run(self) -> None:
        self._sent_s.clear()
        try:
            await self._stream()
        except Exception as error:  # noqa: BLE001  (the server continues and reports it)
            _LOG.exception("the video has ended: its source or its encoder failed")
            self.fault = error
            for player in self._players:
                player.goodbye(self._now())
            self._players.clear()

    async def _stream(self) -> None:
        loop = asyncio.get_running_loop()
        encoder, period_s = Encoder(self._size_px, self._rate_hz), 1.0 / self._rate_hz
        captured_s, due_s = float("-inf"), loop.time()
        while self._players:
            began_s = loop.time()
            key = any(player.wants_key for player in self._players)
            frame = await loop.run_in_executor(self._thread, self._next, encoder, captured_s, key)
            if frame is None:
                await asyncio.sleep(_POLL_S)
                continue
            captured_s, sent_s = frame.captured_s, loop.time()
            for player in tuple(self._players):
                player.send(frame, self._now())
            self._encoded += 1
            self._late += int((sent_s - began_s) / period_s)
            self._sent_s.append(sent_s)
            # Keep the grid of the rate if possible, but do not catch up after a delay.
            due_s = max(due_s + period_s, loop.time())
            await asyncio.sleep(due_s - loop.time())

    def _next(self, encoder: Encoder, after_s: float, key: bool) -> FramePackets | None:  # noqa: FBT001  (run_in_executor takes no names)
        """Fetch and encode a frame on the thread; return None without a newer one."""
        frame = self._newest()
        if frame is None or frame.captured_s <= after_s:
            return None
        nals = encoder.encode(frame.image, frame.captured_s, key=key)
        return packetize(nals, timed_metadata(frame), frame.captured_s)
