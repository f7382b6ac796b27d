"""The video server, tested by clients: ffmpeg's, and one that sees each packet."""

from __future__ import annotations

import asyncio
import struct
import threading
from typing import Any

import av
import pytest

from sim_bridge.loopback import video
from sim_bridge.loopback.encoder import nal_type
from sim_bridge.loopback.metadata import VideoFrame, timed_metadata
from tests.sim_bridge.loopback.video_client import (
    BYE,
    NOW_S,
    SIZE_PX,
    TCP,
    Pictures,
    RtpPacket,
    assert_quadrants,
    frame_at,
    parse_rtcp,
    units_of,
    visiting,
    watched,
)

KEY, OTHER = [7, 8], [1]  # types of the first units of a frame


def kinds(packets: list[RtpPacket]) -> list[int]:
    """Return the types of the units of a frame."""
    return [nal_type(unit) for unit in units_of(packets)]


@pytest.mark.parametrize("way", ["udp", "tcp"])
async def test_ffmpeg_plays_it(way: str) -> None:
    def watch(url: str) -> list[Any]:
        options = {"rtsp_transport": way, "analyzeduration": "0", "fpsprobesize": "0"}
        with av.open(url, options=options, timeout=30.0) as container:
            frames = container.decode(video=0)
            return [next(frames).to_ndarray(format="rgb24") for _ in range(5)]

    async with watched(plays=False) as (_, client):
        for image in await asyncio.to_thread(watch, client.url):
            assert image.shape == (SIZE_PX[1], SIZE_PX[0], 3)
            assert_quadrants(image)


async def test_a_frame_carries_its_metadata_and_a_report_the_drones_time() -> None:
    async with watched(plays=False) as (_, client):
        assert "PLAY" in (await client.ask("OPTIONS", "*")).headers["public"]
        set_up = await client.ask("SETUP", f"{client.url}/stream=0", Transport=TCP)
        playing = await client.ask("PLAY")
        channel, report = await client.packet()
        packets = await client.picture()
        assert f"seq={packets[0].sequence};" in playing.headers["rtp-info"]
        assert set_up.headers["transport"] == f"{TCP};ssrc={packets[0].ssrc:08X}"
        assert set_up.headers["session"].endswith(";timeout=60")
        shown = frame_at(NOW_S + 1 / 30.0)
        assert packets[0].metadata == timed_metadata(shown)
        _, seconds, fraction, stamp = struct.unpack_from("!4I", parse_rtcp(report)[200])
        offset = (packets[0].stamp - stamp + 2**31) % 2**32 - 2**31
        reported_s = seconds + fraction / 2**32 + offset / 90_000
        assert (channel, reported_s) == (1, pytest.approx(shown.captured_s, abs=1e-4))


async def test_the_first_supported_transport_is_chosen() -> None:
    wish = "RTP/AVP;multicast,RTP/AVP/UDP;client_port=5000-5001;destination=192.0.2.1"
    async with watched(plays=False) as (_, client):
        chosen = (await client.ask("SETUP", Transport=wish)).headers["transport"].split(";")
        assert chosen[:3] == ["RTP/AVP", "unicast", "client_port=5000-5001"]
        data_port, control_port = map(int, chosen[3].removeprefix("server_port=").split("-"))
        assert (data_port % 2, control_port) == (0, data_port + 1)


async def at_rest(source: Pictures) -> None:
    """Wait until frames are no longer fetched."""
    asked = -1
    while source.asked != asked:
        asked = source.asked
        await asyncio.sleep(0.1)


async def test_frames_are_fetched_only_while_a_client_plays() -> None:
    """A paused client goes on by a key frame, once, however often it asks."""
    source = Pictures()
    async with watched(source.newest, plays=False) as (served, client):
        await client.ask("SETUP", Transport=TCP)
        assert source.asked == 0
        await client.ask("PLAY")
        await client.picture()
        await client.ask("PAUSE")
        await at_rest(source)
        client.waiting.clear()
        for _ in range(2):
            assert (await client.ask("PLAY")).status == 200
        assert kinds(await client.picture())[:2] == KEY
        assert kinds(await client.picture())[:1] == OTHER
        async with visiting(served) as leaving:
            await leaving.play()
            await client.ask("TEARDOWN")
            leaving.writer.transport.abort()
        await at_rest(source)
        assert served.video.streamer.stats().frames_encoded == source.asked


async def test_a_wrong_request_gets_one_clear_refusal() -> None:
    async with watched(plays=False) as (served, client), visiting(served) as other:
        for status, method, url, headers in (
            (404, "DESCRIBE", "rtsp://127.0.0.1/other", {}),
            (400, "DESCRIBE", "", {"CSeq": "one"}),
            (461, "SETUP", "", {}),
            (461, "SETUP", "", {"Transport": "RTP/AVP;unicast;client_port=65535-65536"}),
            (454, "PLAY", "", {}),
        ):
            found = await client.ask(method, url, **headers)
            assert (found.status, found.headers["content-type"]) == (status, "text/plain"), headers
            assert (await client.ask("DESCRIBE")).status == 200
        # A session is controlled by its name, on its connection.
        await other.ask("SETUP", Transport=TCP)
        for method in ("PLAY", "PAUSE", "TEARDOWN"):
            await client.ask("SETUP", Transport=TCP)
            assert (await client.ask(method, Session=other.session)).status == 454
            assert (await client.ask(method)).status == 200
        assert (await client.ask("TEARDOWN")).status == 454


@pytest.mark.parametrize(
    "garbage",
    [
        b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 99999\r\n\r\n",
        b"PLAY " * 4000,
        b"DESCRIBE \xff\x00\xe9 RTSP/1.0\r\n\r\n",
        b"$\x00\xff\xff",
    ],
)
async def test_garbage_on_the_port_does_no_harm(garbage: bytes) -> None:
    """Its sender is refused; a playing client continues, also one that sends reports."""
    async with watched() as (served, watching):
        async with visiting(served) as vandal:
            vandal.writer.write(garbage)
            vandal.writer.write_eof()
            said = await vandal.reader.read()
            assert said == b"" or said.startswith(b"RTSP/1.0 4")
        watching.waiting.clear()
        assert await watching.picture()
        watching.writer.write(b"$\x01\x00\x08\x81\xc9\x00\x01abcd\r\n")
        assert (await watching.ask("GET_PARAMETER")).status == 200


async def test_a_silent_client_is_sent_away(monkeypatch: pytest.MonkeyPatch) -> None:
    async with watched() as (_, client):
        monkeypatch.setattr(video, "SESSION_TIMEOUT_S", 0.01)  # of the waits after the next answer
        await client.ask("GET_PARAMETER")
        assert await client.goodbye()


async def test_a_source_that_fails_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    def broken() -> VideoFrame:
        raise RuntimeError("no camera")

    async with watched(broken) as (_, client):
        channel, last = await client.packet()
        assert (channel, BYE in parse_rtcp(last)) == (1, True)
        refused = await client.ask("PLAY")
        assert (refused.status, refused.body) == (500, "the video has ended: no camera\n")
    assert "its source or its encoder failed" in caplog.text


async def test_closing_says_goodbye_and_finishes_the_source() -> None:
    """The source is asked and finished on one thread of its own."""
    asked, finished = list[int](), list[int]()

    def newest() -> VideoFrame:
        asked.append(threading.get_ident())
        return frame_at(NOW_S + len(asked) / 30.0)

    def finish() -> None:
        finished.append(threading.get_ident())

    async with watched(newest, finish=finish) as (served, client):
        await client.picture()
        await served.server.close()
        assert await client.goodbye()
    (thread,) = finished
    assert {*asked} == {thread} != {threading.get_ident()}


async def test_clients_share_the_frames_and_each_begins_with_a_key_frame() -> None:
    source = Pictures()
    async with watched(source.newest) as (served, early), visiting(served) as late:
        assert kinds(await early.picture())[:2] == KEY
        assert kinds(await early.picture())[:1] == OTHER
        await late.play()
        shown = await late.picture()
        assert kinds(shown)[:2] == KEY
        while units_of(same := await early.picture()) != units_of(shown):
            pass
        assert same[0].metadata == shown[0].metadata
        assert same[0].ssrc != shown[0].ssrc
        stats = served.video.streamer.stats()
        assert 0 <= source.asked - stats.frames_encoded <= 1  # one is being made
        assert stats.rate_hz > 0.0


async def test_a_slow_client_goes_on_by_a_key_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    async with watched() as (served, client):
        before = (await client.picture())[0].stamp
        with monkeypatch.context() as congested:
            congested.setattr(video, "_MAX_WAITING_BYTES", -1)
            encoded = served.video.streamer.stats().frames_encoded
            while served.video.streamer.stats().frames_encoded < encoded + 3:
                await client.ask("OPTIONS")
        while (packets := await client.picture())[0].stamp == (before + 3000) % 2**32:
            before = packets[0].stamp
        assert kinds(packets)[:2] == KEY


async def test_only_new_frames_are_sent() -> None:
    """Old, repeated and missing frames are skipped."""
    frames = iter([None, frame_at(5.0), frame_at(5.0), frame_at(4.0), None])
    async with watched(lambda: next(frames, frame_at(6.0))) as (served, client):
        first, second = await client.picture(), await client.picture()
        assert (second[0].stamp - first[0].stamp) % 2**32 == 90_000
        assert served.video.streamer.stats().frames_encoded == 2
