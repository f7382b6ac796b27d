"""The newest frame, encoded once, to all clients that play; nothing is done while none does."""

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

# As in Parrot's sender; its receivers tell the capture time from the second report on.
_REPORT_INTERVAL_S: Final = 0.1
_POLL_S: Final = 0.004  # between two looks for a new frame; adds half of it to the latency
_RATE_FRAMES: Final = 60  # the rate is the mean over so many frames
_ENCODED_FRAMES: Final = 1800  # a minute's: what encoding took is taken over so many frames


@dataclass(kw_only=True)
class VideoStats:
    """What the video has done so far."""

    playing: int = 0  # clients now
    frames_encoded: int = 0
    frames_sent: int = 0  # added up over all clients that ever played, like the next ones
    frames_dropped: int = 0  # left out because a client did not keep up
    packets_sent: int = 0
    bytes_sent: int = 0
    frames_late: int = 0  # slots of the wanted rate that passed while a frame was being made
    rate_hz: float = 0.0  # reached lately; 0 before the second frame
    # Fetching, encoding and cutting into packets: median and 95 % of the frames made lately.
    encode_ms: tuple[float, float] = (0.0, 0.0)
    age_ms: tuple[float, float] = (0.0, 0.0)  # likewise, from capture until all was sent


class Player:
    """One client that plays.

    Args:
        stream: numbers its packets.
        sink: takes them.
    """

    def __init__(self, stream: RtpStream, sink: Sink) -> None:
        self.stream = stream
        self._sink = sink
        self.needs_key = True  # the client cannot decode what comes before the next key frame
        self._reported_s = float("-inf")

    @property
    def wants_key(self) -> bool:
        """Whether it waits for a key frame, and could take it."""
        return self.needs_key and not self._sink.congested

    def send(self, frame: FramePackets, now_s: float, stats: VideoStats) -> None:
        """Send a frame, unless the client cannot use it or does not keep up.

        Args:
            frame: the frame as packets.
            now_s: the monotonic time.
            stats: counts what is sent.
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
    """Fetches, encodes and sends while there are players.

    Args:
        source: where frames come from; called on the encoder's thread.
        config: of the encoder.
        now: the monotonic clock of the frames' times.
        failed: called when the source or the encoder raised; then no client plays any more.
        finish: called once, in the end, on the source's thread.
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
        self._encoder: Encoder | None = None  # the thread's
        self._captured_s = float("-inf")  # the thread's: capture time of the newest encoded frame
        self._task: asyncio.Task[None] | None = None
        self._closing = asyncio.Event()
        self._stats = VideoStats()
        self._times_s: deque[float] = deque(maxlen=_RATE_FRAMES)
        self._encode_s: deque[float] = deque(maxlen=_ENCODED_FRAMES)
        self._ages_s: deque[float] = deque(maxlen=_ENCODED_FRAMES)

    def add(self, player: Player) -> None:
        """Send to this client, too, from a key frame on, which is made for it."""
        if player in self._players:
            return
        player.needs_key = True
        self._players.append(player)
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())

    def remove(self, player: Player) -> None:
        """Send nothing more to this client; one that does not play is no error."""
        if player in self._players:
            self._players.remove(player)

    def stats(self) -> VideoStats:
        """Return what was done so far."""
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
        """Stop; a frame under way is finished first. Safe to call twice."""
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
        except Exception as error:  # noqa: BLE001  (the server goes on and reports it)
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
            # On the grid where it can be, so that the rate is kept; never faster to make up.
            due_s = max(due_s + period_s, loop.time())
            await self._pause(due_s - loop.time())

    async def _pause(self, duration_s: float) -> None:
        with contextlib.suppress(TimeoutError):  # the usual end of it
            await asyncio.wait_for(self._closing.wait(), duration_s)

    def _next(self, key: bool) -> FramePackets | None:  # noqa: FBT001  (run_in_executor takes no names)
        """Fetch and encode on the thread; None when there is no newer frame."""
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
