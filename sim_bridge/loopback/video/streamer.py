"""Streamer: encodes the newest frame once and sends it to all playing clients."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sim_bridge.loopback.video.encoder import Encoder, EncoderConfig
from sim_bridge.loopback.video.frame import FrameSource, timed_metadata
from sim_bridge.loopback.video.rtp import FramePackets, RtpStream
from sim_bridge.loopback.video.transport import Sink

_LOG: Final = logging.getLogger(__name__)

# As in Parrot's sender; its receivers compute the capture time from the second report on.
_REPORT_INTERVAL_S: Final = 0.1
_POLL_S: Final = 0.004  # polling period for a new frame; half of it adds to the latency
_RATE_FRAMES: Final = 60  # number of frames for the mean rate
_ENCODED_FRAMES: Final = 1800  # number of frames for the encoding times: one minute


@dataclass(kw_only=True)
class VideoStats:
    """Statistics of the video since its start."""

    playing: int = 0  # clients that play now
    frames_encoded: int = 0
    frames_sent: int = 0  # sum over all clients, as are the next counters
    frames_dropped: int = 0  # frames skipped because a client was too slow
    packets_sent: int = 0
    bytes_sent: int = 0
    frames_late: int = 0  # frame slots that passed while another frame was being made
    rate_hz: float = 0.0  # mean rate of recent frames; 0 before the second frame
    # Time to fetch, encode and packetize recent frames: median and 95th percentile.
    encode_ms: tuple[float, float] = (0.0, 0.0)
    age_ms: tuple[float, float] = (0.0, 0.0)  # time from capture to sending, in the same way


class Player:
    """One playing client.

    Args:
        stream: numbers the packets.
        sink: sends the packets.
    """

    def __init__(self, stream: RtpStream, sink: Sink) -> None:
        self.stream = stream
        self._sink = sink
        self.needs_key = True  # whether the client can only decode from the next key frame on
        self._reported_s = float("-inf")

    @property
    def wants_key(self) -> bool:
        """Whether the client needs a key frame and is not congested."""
        return self.needs_key and not self._sink.congested

    def send(self, frame: FramePackets, now_s: float, stats: VideoStats) -> None:
        """Send a frame unless the client cannot decode it or is too slow.

        Args:
            frame: the frame as packets.
            now_s: present time by the monotonic clock, s.
            stats: the counters to update.
        """
        if self._sink.congested:
            self.needs_key = True
        if self.needs_key and not (frame.is_key and self.wants_key):
            stats.frames_dropped += 1
            return
        self.needs_key = False
        if now_s - self._reported_s >= _REPORT_INTERVAL_S:
            self._reported_s = now_s
            self._sink.send_control(self.stream.report(now_s))
        packets = tuple(self.stream.packets(frame))
        self._sink.send_data(packets)
        stats.frames_sent += 1
        stats.packets_sent += len(packets)
        stats.bytes_sent += sum(len(packet) for packet in packets)

    def goodbye(self, now_s: float) -> None:
        """Send the client a BYE packet."""
        self._sink.send_control(self.stream.goodbye(now_s))


class Streamer:
    """Fetches, encodes and sends frames while clients play.

    Args:
        source: source of the frames; called on the encoder's thread.
        config: configuration of the encoder.
        now: monotonic clock of the capture times, s.
        failed: called after an error of the source or the encoder, which ends the video.
        finish: called once, at the end, on the source's thread.
    """

    def __init__(
        self,
        source: FrameSource,
        config: EncoderConfig,
        *,
        now: Callable[[], float],
        failed: Callable[[Exception], None],
        finish: Callable[[], None] | None = None,
    ) -> None:
        self._source = source
        self._config = config
        self._now = now
        self._failed = failed
        self._finish = finish
        self._players: list[Player] = []
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="loopback-video")
        self._encoder: Encoder | None = None  # used on the thread only
        self._captured_s = float("-inf")  # on the thread only: capture time of the last frame
        self._task: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()
        self._stats = VideoStats()
        self._times_s: deque[float] = deque(maxlen=_RATE_FRAMES)
        self._encode_s: deque[float] = deque(maxlen=_ENCODED_FRAMES)
        self._ages_s: deque[float] = deque(maxlen=_ENCODED_FRAMES)

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
        times_s = self._times_s
        rate_hz = (len(times_s) - 1) / (times_s[-1] - times_s[0]) if len(times_s) > 1 else 0.0
        return replace(
            self._stats,
            playing=len(self._players),
            rate_hz=rate_hz,
            encode_ms=_percentiles_ms(self._encode_s),
            age_ms=_percentiles_ms(self._ages_s),
        )

    async def close(self) -> None:
        """Stop after the frame in progress; safe to call twice."""
        self._closing.set()
        self._players.clear()
        if self._task is not None:
            await self._task
        finish, self._finish = self._finish, None
        if finish is not None:
            await asyncio.get_running_loop().run_in_executor(self._thread, finish)
        self._thread.shutdown()

    async def _run(self) -> None:
        self._encoder = None
        self._captured_s = float("-inf")
        self._times_s.clear()
        try:
            await self._stream()
        except Exception as error:  # noqa: BLE001  (the server continues and reports it)
            _LOG.exception("the video has ended: its source or its encoder failed")
            self._players.clear()
            self._failed(error)

    async def _stream(self) -> None:
        loop = asyncio.get_running_loop()
        period_s = 1.0 / self._config.rate_hz
        due_s = began_s = loop.time()
        while self._players:
            key = any(player.wants_key for player in self._players)
            began_s = loop.time()
            packets = await loop.run_in_executor(self._thread, self._next, key)
            if packets is None:
                await self._pause(_POLL_S)
                continue
            encode_s = loop.time() - began_s
            self._encode_s.append(encode_s)
            self._stats.frames_late += int(encode_s / period_s)
            self._stats.frames_encoded += 1
            self._times_s.append(loop.time())
            now_s = self._now()
            for player in tuple(self._players):
                player.send(packets, now_s, self._stats)
            self._ages_s.append(self._now() - self._captured_s)
            # Keep the grid of the rate if possible, but do not catch up after a delay.
            due_s = max(due_s + period_s, loop.time())
            await self._pause(due_s - loop.time())

    async def _pause(self, duration_s: float) -> None:
        with contextlib.suppress(TimeoutError):  # the usual end of the pause
            await asyncio.wait_for(self._closing.wait(), duration_s)

    def _next(self, key: bool) -> FramePackets | None:  # noqa: FBT001  (run_in_executor takes no names)
        """Fetch and encode on the thread; return None without a newer frame."""
        frame = self._source.newest()
        if frame is None or frame.captured_s <= self._captured_s:
            return None
        self._captured_s = frame.captured_s
        if self._encoder is None:
            self._encoder = Encoder(self._config)
        encoded = self._encoder.encode(frame.image, frame.captured_s, key=key)
        return FramePackets.of(encoded, timed_metadata(frame), frame.captured_s)


def _percentiles_ms(times_s: deque[float]) -> tuple[float, float]:
    p50_s, p95_s = np.percentile(times_s or [0.0], [50, 95])
    return 1e3 * float(p50_s), 1e3 * float(p95_s)
