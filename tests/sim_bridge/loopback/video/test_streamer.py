"""The streamer sends the newest frame, encoded once, to all playing clients."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterable

import pytest

from sim_bridge.loopback.video.encoder import EncoderConfig, nal_type
from sim_bridge.loopback.video.frame import FrameSource, VideoFrame
from sim_bridge.loopback.video.rtp import RtpStream
from sim_bridge.loopback.video.streamer import Player, Streamer
from tests.sim_bridge.loopback.video.video_client import (
    SIZE_PX,
    Pictures,
    parse_rtp,
    quadrants,
    reassemble,
    run,
    seeded,
)

CONFIG = EncoderConfig(size_px=SIZE_PX, rate_hz=240.0, keyframe_interval_s=1000.0)


class Sink:
    """Stores sent packets and wakes a waiting test."""

    def __init__(self) -> None:
        self.congested = False
        self.pictures: asyncio.Queue[list[bytes]] = asyncio.Queue()
        self.control: list[bytes] = []

    def send_data(self, packets: Iterable[bytes]) -> None:
        self.pictures.put_nowait(list(packets))

    def send_control(self, packet: bytes) -> None:
        self.control.append(packet)

    async def kinds(self) -> list[int]:
        """Return the types of the NAL units of the next frame."""
        packets = await self.pictures.get()
        return [nal_type(u) for u in reassemble(parse_rtp(p).payload for p in packets)]


def make(
    source: FrameSource,
    failed: Callable[[Exception], None] | None = None,
    finish: Callable[[], None] | None = None,
) -> Streamer:
    return Streamer(source, CONFIG, now=lambda: 100.0, failed=failed or _unexpected, finish=finish)


def _unexpected(error: Exception) -> None:
    pytest.fail(f"the streamer failed: {error}")


def player(sink: Sink, seed: int = 1) -> Player:
    return Player(RtpStream(seeded(seed), "X"), sink)


def test_nothing_is_asked_of_the_source_while_no_client_plays() -> None:
    async def work() -> None:
        source = Pictures()
        streamer = make(source)
        sink = Sink()
        only = player(sink)
        streamer.add(only)
        await sink.pictures.get()
        streamer.remove(only)
        assert streamer._task is not None
        await streamer._task  # the task ends
        assert source.asked == streamer.stats().frames_encoded >= 1
        await streamer.close()

    run(work())


def test_the_first_picture_of_every_client_is_a_key_frame() -> None:
    """Also for a later client, and for one that resumes after a pause."""

    async def work() -> None:
        streamer = make(Pictures())
        early, late = Sink(), Sink()
        first, second = player(early), player(late, 2)
        streamer.add(first)
        assert (await early.kinds())[0] == 7
        assert set(await early.kinds()) == {1}
        streamer.add(second)
        assert (await late.kinds())[0] == 7
        streamer.remove(first)
        assert set(await late.kinds()) == {1}
        while not early.pictures.empty():
            early.pictures.get_nowait()
        streamer.add(first)
        assert (await early.kinds())[0] == 7
        await streamer.close()

    run(work())


def test_clients_share_one_encoder_and_have_numbers_of_their_own() -> None:
    async def work() -> None:
        source = Pictures()
        streamer = make(source)
        sinks = [Sink(), Sink(), Sink()]
        for seed, sink in enumerate(sinks):
            streamer.add(player(sink, seed))
        shown = [await sink.pictures.get() for sink in sinks]
        await streamer.close()
        bodies = [[packet[12:] for packet in packets] for packets in shown]
        assert bodies[0] == bodies[1] == bodies[2]
        assert len({parse_rtp(packets[0]).ssrc for packets in shown}) == 3
        stats = streamer.stats()
        assert stats.frames_encoded == source.asked
        assert stats.frames_sent == 3 * stats.frames_encoded
        assert stats.packets_sent >= stats.frames_sent
        assert 0.0 < stats.encode_ms[0] <= stats.encode_ms[1]
        assert stats.age_ms[0] <= stats.age_ms[1] < 0.0  # the captures are later than the clock

    run(work())


def test_a_client_that_does_not_keep_up_misses_pictures_and_begins_again_with_a_key() -> None:
    async def work() -> None:
        streamer = make(Pictures())
        slow, quick = Sink(), Sink()
        streamer.add(player(slow, 1))
        streamer.add(player(quick, 2))
        await slow.kinds()
        slow.congested = True
        await quick.kinds()
        before = streamer.stats().frames_dropped
        while not slow.pictures.empty():
            slow.pictures.get_nowait()
        for _ in range(4):
            await quick.pictures.get()
        assert slow.pictures.empty()
        assert streamer.stats().frames_dropped > before
        slow.congested = False
        assert (await slow.kinds())[0] == 7
        await streamer.close()

    run(work())


def test_a_picture_is_shown_once_and_none_is_no_error() -> None:
    """Old, repeated and missing frames are skipped; the next new one is sent."""

    class Sometimes:
        def __init__(self) -> None:
            self.times = iter([None, 5.0, 5.0, 4.0, None, 6.0])
            self.last: float | None = None

        def newest(self) -> VideoFrame | None:
            time_s = next(self.times, self.last)
            self.last = time_s
            return None if time_s is None else VideoFrame(image=quadrants(), captured_s=time_s)

    async def work() -> None:
        streamer = make(Sometimes())
        sink = Sink()
        streamer.add(player(sink))
        stamps = [parse_rtp((await sink.pictures.get())[0]).stamp for _ in range(2)]
        await streamer.close()
        assert (stamps[1] - stamps[0]) % 2**32 == 90_000
        assert streamer.stats().frames_encoded == 2
        assert sink.pictures.empty()

    run(work())


def test_the_first_report_comes_before_the_first_picture() -> None:
    async def work() -> None:
        streamer = make(Pictures())
        sink = Sink()
        only = player(sink)
        streamer.add(only)
        await sink.pictures.get()
        assert sink.control[0][1] == 200
        only.goodbye(100.0)
        assert sink.control[-1][-8:-4] == b"\x81\xcb\x00\x01"
        await streamer.close()

    run(work())


def test_a_source_that_fails_ends_the_video_and_says_why(caplog: pytest.LogCaptureFixture) -> None:
    class Broken:
        def newest(self) -> None:
            raise RuntimeError("no camera")

    async def work() -> None:
        failures: asyncio.Queue[Exception] = asyncio.Queue()
        streamer = make(Broken(), failures.put_nowait)
        streamer.add(player(Sink()))
        assert str(await failures.get()) == "no camera"
        await streamer.close()
        assert streamer.stats().playing == 0

    run(work())
    assert "its source or its encoder failed" in caplog.text


def test_the_source_is_asked_and_finished_on_one_thread_of_its_own() -> None:
    class Where(Pictures):
        def __init__(self) -> None:
            super().__init__()
            self.threads: set[int] = set()
            self.finished: list[int] = []

        def finish(self) -> None:
            self.finished.append(threading.get_ident())

        def newest(self) -> VideoFrame:
            self.threads.add(threading.get_ident())
            return super().newest()

    async def work() -> None:
        source, sink = Where(), Sink()
        streamer = make(source, finish=source.finish)
        only = player(sink)
        streamer.add(only)
        await sink.pictures.get()
        streamer.remove(only)
        streamer.add(only)
        await sink.pictures.get()
        await streamer.close()
        await streamer.close()
        assert source.finished == list(source.threads)
        assert len(source.threads) == 1
        assert threading.get_ident() not in source.threads

    run(work())
