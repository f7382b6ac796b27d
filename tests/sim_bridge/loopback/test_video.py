"""The video server, tested by clients: ffmpeg's, and one that sees each packet."""

from __future__ import annotations

import asyncio
import struct
import threading
from contextlib import AsyncExitStack
from typing import Any

import av
import pytest

from sim_bridge.loopback import video
from sim_bridge.loopback.encoder import nal_type
from sim_bridge.loopback.metadata import VideoFrame, timed_metadata
from tests.sim_bridge.loopback.loopback_client import HOST
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
    parse_rtp,
    serving,
    units_of,
    visiting,
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

    async with serving() as server:
        for image in await asyncio.to_thread(watch, f"rtsp://{HOST}:{server.port}/live"):
            assert image.shape == (SIZE_PX[1], SIZE_PX[0], 3)
            assert_quadrants(image)


async def test_a_frame_carries_its_metadata_and_a_report_the_drones_time() -> None:
    async with serving() as server, visiting(server) as client:
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


async def test_the_client_is_told_what_the_stream_is() -> None:
    """The order is that of RFC 8866; Olympe finds the medium by its name and refuses a range."""
    async with serving(media_name="DefaultVideo") as server, visiting(server) as client:
        described = await client.ask("DESCRIBE")
        assert described.headers["content-base"] == f"{client.url}/"
    session, medium = described.body.removesuffix("\r\n").split("\r\nm=")
    assert "".join(line[0] for line in session.split("\r\n")).rstrip("a") == "vosict"
    assert medium.startswith("video 0 RTP/AVP 96\r\ni=DefaultVideo\r\na=rtpmap:96 H264/90000\r\n")
    assert "packetization-mode=1;profile-level-id=42C0" in medium
    assert "a=X-com-parrot-serial:PI9\r\n" in described.body
    assert "a=range" not in described.body


async def test_udp_packets_come_from_the_ports_that_the_answer_names() -> None:
    """They go to the client only, whatever destination it asks for."""
    heard: asyncio.Queue[tuple[int, bytes]] = asyncio.Queue()

    class Inbox(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
            heard.put_nowait((addr[1], data))

    endpoint = asyncio.get_running_loop().create_datagram_endpoint
    inbox, _ = await endpoint(Inbox, local_addr=(HOST, 0))
    port = inbox.get_extra_info("sockname")[1]
    async with serving() as server, visiting(server) as client:
        wish = f"RTP/AVP;multicast,RTP/AVP/UDP;client_port={port}-{port};destination=192.0.2.1"
        chosen = (await client.play(wish)).headers["transport"].split(";")
        assert chosen[:3] == ["RTP/AVP", "unicast", f"client_port={port}-{port}"]
        data_port, control_port = map(int, chosen[3].removeprefix("server_port=").split("-"))
        assert (data_port % 2, control_port) == (0, data_port + 1)
        source, report = await heard.get()
        assert (source, 200 in parse_rtcp(report)) == (control_port, True)
        source, data = await heard.get()
        assert (source, f"ssrc={parse_rtp(data).ssrc:08X}") == (data_port, chosen[4])
        await client.ask("TEARDOWN")
        while source != control_port or BYE not in parse_rtcp(data):
            source, data = await heard.get()
    inbox.close()


async def at_rest(source: Pictures) -> None:
    """Wait until frames are no longer fetched."""
    asked = -1
    while source.asked != asked:
        asked = source.asked
        await asyncio.sleep(0.1)


async def test_frames_are_fetched_only_while_a_client_plays() -> None:
    """A paused client goes on by a key frame, with the next sequence number."""
    source = Pictures()
    async with serving(source.newest) as server, visiting(server) as client:
        await client.ask("SETUP", Transport=TCP)
        assert source.asked == 0
        await client.ask("PLAY")
        last = (await client.picture())[-1]
        await client.ask("PAUSE")
        await at_rest(source)
        for data in [data for channel, data in client.waiting if channel == 0]:
            last = parse_rtp(data)
        client.waiting.clear()
        again = await client.ask("PLAY")
        assert f"seq={(last.sequence + 1) % 65536};" in again.headers["rtp-info"]
        assert (await client.ask("PLAY")).status == 200
        packets = await client.picture()
        assert packets[0].sequence == (last.sequence + 1) % 65536
        assert kinds(packets)[:2] == KEY
        async with visiting(server) as leaving:
            await leaving.play()
            await client.ask("TEARDOWN")
            leaving.writer.transport.abort()
        await at_rest(source)
        assert server.video.streamer.stats().frames_encoded == source.asked


async def test_a_wrong_request_gets_one_clear_refusal() -> None:
    async with serving() as server, visiting(server) as client, visiting(server) as other:
        for status, method, url, headers in (
            (404, "DESCRIBE", "rtsp://127.0.0.1/other", {}),
            (404, "DESCRIBE", "http://127.0.0.1/live", {}),
            (400, "DESCRIBE", "", {"CSeq": "one"}),
            (461, "SETUP", "", {}),
            (461, "SETUP", "", {"Transport": "RTP/SAVP;unicast;client_port=1-2"}),
            (461, "SETUP", "", {"Transport": "RTP/AVP;multicast;port=5000-5001"}),
            (461, "SETUP", "", {"Transport": "RTP/AVP;unicast;client_port=65535-65536"}),
            (461, "SETUP", "", {"Transport": "RTP/AVP/TCP;interleaved=255-256"}),
            (461, "SETUP", "", {"Transport": "RTP/AVP/TCP;interleaved=a-b"}),
            (454, "PLAY", "", {}),
            (501, "RECORD", "", {}),
        ):
            found = await client.ask(method, url, **headers)
            assert (found.status, found.headers["content-type"]) == (status, "text/plain"), headers
            assert found.body.endswith("\n")
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
        b"OPTIONS * RTSP/2.0\r\n\r\n",
        b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 99999\r\n\r\n",
        b"PLAY " * 4000,
        b"\x16\x03\x01\x02\x00\x01" + bytes(range(256)),  # a TLS greeting
        b"DESCRIBE \xff\x00\xe9 RTSP/1.0\r\n\r\n",
        b"$\x00\xff\xff",
        b"",
    ],
)
async def test_garbage_on_the_port_does_no_harm(garbage: bytes) -> None:
    """Its sender is refused; a playing client continues, also one that sends reports."""
    async with serving() as server, visiting(server) as watching:
        await watching.play()
        async with visiting(server) as vandal:
            vandal.writer.write(garbage)
            vandal.writer.write_eof()
            said = await vandal.reader.read()
            assert said == b"" or said.startswith(b"RTSP/1.0 4")
        watching.waiting.clear()
        assert await watching.picture()
        watching.writer.write(b"$\x01\x00\x08\x81\xc9\x00\x01abcd\r\n")
        assert (await watching.ask("GET_PARAMETER")).status == 200


async def test_a_silent_client_is_sent_away(monkeypatch: pytest.MonkeyPatch) -> None:
    async with serving() as server, visiting(server) as client:
        await client.play()
        monkeypatch.setattr(video, "SESSION_TIMEOUT_S", 0.01)  # of the waits after the next answer
        await client.ask("GET_PARAMETER")
        assert await client.goodbye()


async def test_a_source_that_fails_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    def broken() -> VideoFrame:
        raise RuntimeError("no camera")

    async with serving(broken) as server, visiting(server) as client:
        await client.play()
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

    async with AsyncExitStack() as stack:
        served = serving(newest, finish=lambda: finished.append(threading.get_ident()))
        server = await stack.enter_async_context(served)
        async with visiting(server) as client:
            await client.play()
            await client.picture()
            await stack.aclose()
            assert await client.goodbye()
    (thread,) = finished
    assert {*asked} == {thread} != {threading.get_ident()}


async def test_clients_share_the_frames_and_each_begins_with_a_key_frame() -> None:
    source = Pictures()
    async with (
        serving(source.newest) as server,
        visiting(server) as early,
        visiting(server) as late,
    ):
        await early.play()
        assert kinds(await early.picture())[:2] == KEY
        assert kinds(await early.picture())[:1] == OTHER
        await late.play()
        shown = await late.picture()
        assert kinds(shown)[:2] == KEY
        while units_of(same := await early.picture()) != units_of(shown):
            pass
        assert same[0].metadata == shown[0].metadata
        assert same[0].ssrc != shown[0].ssrc
        stats = server.video.streamer.stats()
        assert 0 <= source.asked - stats.frames_encoded <= 1  # one is being made
        assert stats.rate_hz > 0.0


async def test_a_slow_client_goes_on_by_a_key_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    async with serving() as server, visiting(server) as client:
        await client.play()
        before = (await client.picture())[0].stamp
        with monkeypatch.context() as congested:
            congested.setattr(video, "_MAX_WAITING_BYTES", -1)
            encoded = server.video.streamer.stats().frames_encoded
            while server.video.streamer.stats().frames_encoded < encoded + 3:
                await client.ask("OPTIONS")
        while (packets := await client.picture())[0].stamp == (before + 3000) % 2**32:
            before = packets[0].stamp
        assert kinds(packets)[:2] == KEY


async def test_only_new_frames_are_sent() -> None:
    """Old, repeated and missing frames are skipped."""
    frames = iter([None, frame_at(5.0), frame_at(5.0), frame_at(4.0), None])
    async with serving(lambda: next(frames, frame_at(6.0))) as server, visiting(server) as client:
        await client.play()
        first, second = await client.picture(), await client.picture()
        assert (second[0].stamp - first[0].stamp) % 2**32 == 90_000
        assert server.video.streamer.stats().frames_encoded == 2
