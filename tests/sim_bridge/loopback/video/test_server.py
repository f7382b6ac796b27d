"""The whole server, tested by clients."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import av
import numpy as np
import pytest

from sim_bridge.loopback.handshake import PortTakenError
from sim_bridge.loopback.video import connection
from sim_bridge.loopback.video.connection import MAX_CONNECTIONS
from sim_bridge.loopback.video.encoder import EncoderConfig
from sim_bridge.loopback.video.frame import FrameSource
from sim_bridge.loopback.video.server import VideoServer, serve_video
from tests.sim_bridge.loopback.video.video_client import (
    COLOURS,
    SIZE_PX,
    Pictures,
    RtspClient,
    centres,
    collect,
    decodable,
    fields,
    open_inbox,
    parse_answer,
    parse_rtcp,
    reassemble,
    run,
    seeded,
    unpack_metadata,
)
from uav_bt.errors import ValueRangeError

TCP = "RTP/AVP/TCP;unicast;interleaved=0-1"
GOODBYE = 203


@asynccontextmanager
async def serving(source: FrameSource | None = None, **options: Any) -> AsyncIterator[VideoServer]:
    """Serve on a free port; the clock of the frames is constant at 100 s."""
    config = EncoderConfig(size_px=SIZE_PX, rate_hz=120.0)
    server = await serve_video(
        source or Pictures(),
        port=0,
        encoder=config,
        now=lambda: 100.0,
        random=seeded(1),
        **options,
    )
    try:
        yield server
    finally:
        await server.close()


def test_over_one_connection_the_picture_and_its_metadata_arrive() -> None:
    async def work() -> None:
        async with serving() as server:
            client = await RtspClient.connect(server.url)
            described = await client.ask("DESCRIBE", Accept="application/sdp")
            assert b"m=video 0 RTP/AVP 96\r\ni=Front camera\r\n" in described.body
            assert (await client.set_up(TCP)).status == 200
            playing = await client.ask("PLAY")
            packets = await client.picture()
            info = dict(part.split("=", 1) for part in playing.headers["rtp-info"].split(";"))
            assert int(info["seq"]) == packets[0].sequence
            (frame,) = decoded(packets)
            assert np.abs(centres(frame) - np.array(COLOURS)).max() <= 6
            number, content = packets[0].extension or (0, b"")
            camera = fields(fields(unpack_metadata(content))[2])
            assert (number, camera[1]) == (0x5062, round(1e6 * (100.0 + 1 / 30.0)))
            # A report gives the drone's time of the timestamp: the capture time above.
            _, seconds, fraction, stamp = struct.unpack_from(
                "!4I", parse_rtcp(client.reports[0])[200]
            )
            reported_s = seconds + fraction / 2**32
            offset = (packets[0].stamp - stamp + 2**31) % 2**32 - 2**31
            assert reported_s + offset / 90_000 == pytest.approx(camera[1] * 1e-6, abs=1e-4)
            await client.close()

    run(work())


def test_by_datagrams_the_picture_arrives_and_a_goodbye_in_the_end() -> None:
    async def work() -> None:
        async with serving() as server:
            client = await RtspClient.connect(server.url)
            data, data_box, data_port = await open_inbox()
            control, control_box, control_port = await open_inbox()
            wish = f"RTP/AVP;unicast;client_port={data_port}-{control_port}"
            chosen = (await client.set_up(wish)).headers["transport"]
            assert f"client_port={data_port}-{control_port}" in chosen
            await client.ask("PLAY")
            packets = await collect(data_box.queue.get)
            assert np.abs(centres(decoded(packets)[0]) - np.array(COLOURS)).max() <= 6
            assert f"ssrc={packets[0].ssrc:08X}" in chosen
            await client.ask("TEARDOWN")
            while GOODBYE not in parse_rtcp(await control_box.queue.get()):
                pass
            assert server.stats().playing == 0
            await client.close()
            data.close()
            control.close()

    run(work())


async def media_ports(server: VideoServer) -> list[int]:
    """Return the server's UDP ports for a client with datagrams."""
    client = await RtspClient.connect(server.url)
    header = (await client.set_up("RTP/AVP;unicast;client_port=5000-5001")).headers["transport"]
    await client.close()
    ports = dict(part.partition("=")[::2] for part in header.split(";"))["server_port"]
    return [int(port) for port in ports.split("-")]


def decoded(packets: list[Any]) -> list[Any]:
    stream = decodable(reassemble(packet.payload for packet in packets))
    decoder = av.CodecContext.create("h264", "r")
    frames = [*decoder.decode(av.Packet(stream)), *decoder.decode(None)]
    return [frame.to_ndarray(format="rgb24") for frame in frames]


@pytest.mark.parametrize("way", ["udp", "tcp"])
def test_ffmpeg_plays_it(way: str) -> None:
    def watch(url: str) -> list[Any]:
        options = {"rtsp_transport": way, "analyzeduration": "0", "fpsprobesize": "0"}
        with av.open(url, options=options, timeout=15.0) as container:
            frames = container.decode(video=0)
            return [next(frames).to_ndarray(format="rgb24") for _ in range(5)]

    async def work() -> None:
        async with serving() as server:
            for image in await asyncio.to_thread(watch, server.url):
                assert image.shape == (SIZE_PX[1], SIZE_PX[0], 3)
                assert np.abs(centres(image) - np.array(COLOURS)).max() <= 6

    run(work())


def test_a_paused_client_gets_nothing_and_goes_on_where_it_was() -> None:
    async def work() -> None:
        async with serving() as server:
            client = await RtspClient.connect(server.url)
            await client.set_up(TCP)
            await client.ask("PLAY")
            last = (await client.picture())[-1]
            await client.ask("PAUSE")
            while client.waiting:
                if client.waiting[0][0] == 0:
                    last = (await client.picture())[-1]
                else:
                    await client.packet()
            assert server.stats().playing == 0
            again = await client.ask("PLAY")
            assert f"seq={(last.sequence + 1) % 65536};" in again.headers["rtp-info"]
            first, *_ = await client.picture()
            assert first.sequence == (last.sequence + 1) % 65536
            await client.close()

    run(work())


def test_a_client_that_vanishes_is_forgotten() -> None:
    """After its connection is lost, no frames are fetched for it."""

    async def work() -> None:
        source = Pictures()
        async with serving(source) as server:
            leaving = await RtspClient.connect(server.url)
            await leaving.set_up(TCP)
            await leaving.ask("PLAY")
            await leaving.picture()
            leaving.writer.transport.abort()
            staying = await RtspClient.connect(server.url)
            while server.stats().playing:
                await staying.ask("OPTIONS")
            await staying.close()

    run(work())


@pytest.mark.parametrize("seed", range(8))
def test_garbage_on_the_port_does_no_harm(seed: int, caplog: pytest.LogCaptureFixture) -> None:
    """A playing client continues, and the next client is served."""
    random = seeded(seed)

    def garbage() -> bytes:
        kinds = (
            random.randbytes(random.randrange(1, 3000)),
            b"DESCRIBE " + random.randbytes(40) + b" RTSP/1.0\r\n\r\n",
            b"$" + random.randbytes(random.randrange(1, 60)),
            b"SETUP rtsp://x/live RTSP/1.0\r\nCSeq: 1\r\nTransport: "
            + random.randbytes(20).hex().encode()
            + b"\r\n\r\n",
            b"\r\n" * random.randrange(1, 500),
            b"PLAY " * 3000,
        )
        return random.choice(kinds)

    async def work() -> None:
        async with serving() as server:
            watcher = await RtspClient.connect(server.url)
            await watcher.set_up(TCP)
            await watcher.ask("PLAY")
            for _ in range(20):
                reader, writer = await asyncio.open_connection(*server.address)
                writer.write(garbage())
                writer.write_eof()
                said = b""
                with contextlib.suppress(ConnectionResetError):  # disconnected with unread bytes
                    said = await reader.read()
                assert said == b"" or said.startswith((b"RTSP/1.0 4", b"RTSP/1.0 5"))
                writer.close()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as loose:
                for port in await media_ports(server):
                    loose.sendto(random.randbytes(200), ("127.0.0.1", port))
            assert len(await watcher.picture()) > 0
            assert (await watcher.ask("OPTIONS")).status == 200
            assert server.fault is None
            await watcher.close()

    run(work())
    assert caplog.messages == []  # asyncio logs errors of its callbacks


def test_a_silent_client_is_disconnected_with_a_goodbye() -> None:
    """Sending to a host that vanished without closing its connection ends."""

    async def work() -> None:
        async with serving(session_timeout_s=0.2) as server:
            client = await RtspClient.connect(server.url)
            await client.set_up(TCP)
            await client.ask("PLAY")
            last = await client.last_packet()
            assert (last[0], GOODBYE in parse_rtcp(last[1])) == (1, True)
            assert server.stats().playing == 0
            await client.close()

    run(work())


def test_reports_of_a_client_keep_its_session_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: asyncio.Queue[connection.Connection] = asyncio.Queue()

    def touched(one: connection.Connection) -> None:
        heard.put_nowait(one)

    async def work() -> None:
        async with serving() as server:
            client = await RtspClient.connect(server.url)
            other = await RtspClient.connect(server.url)
            control, _box, port = await open_inbox()
            await client.set_up(f"RTP/AVP;unicast;client_port={port - 1}-{port}")
            report_port = (await media_ports(server))[1]
            await other.ask("OPTIONS")
            monkeypatch.setattr(connection.Connection, "touch", touched)
            control.sendto(b"\x81\xc9\x00\x01" + bytes(4), ("127.0.0.1", report_port))
            assert (await heard.get())._report_address == ("127.0.0.1", port)
            for one in (client, other):
                await one.close()
            control.close()

    run(work())


def test_clients_that_idle_make_room() -> None:
    """The longest silent connection is closed; one with a stream stays."""

    async def work() -> None:
        async with serving() as server:
            watches = await RtspClient.connect(server.url)
            assert (await watches.set_up(TCP)).status == 200
            idle = [await RtspClient.connect(server.url) for _ in range(MAX_CONNECTIONS - 1)]
            for client in idle:
                assert (await client.ask("OPTIONS")).status == 200
            for _ in range(2):
                new = await RtspClient.connect(server.url)
                assert (await new.ask("DESCRIBE")).status == 200
                await new.close()
            assert await idle[0].reader.read() == b""
            assert (await idle[-1].ask("OPTIONS")).status == 200
            assert (await watches.ask("PLAY")).status == 200
            for client in (watches, *idle):
                await client.close()

    run(work())


@pytest.mark.parametrize("name", ["Front camera", "DefaultVideo"])
def test_the_stream_has_the_name_that_is_wanted(name: str) -> None:
    async def work() -> None:
        async with serving(media_name=name) as server:
            client = await RtspClient.connect(server.url)
            described = await client.ask("DESCRIBE", Accept="application/sdp")
            assert f"\r\ni={name}\r\na=rtpmap".encode() in described.body
            await client.close()

    run(work())


def test_too_many_clients_are_sent_away_with_a_reason() -> None:
    async def work() -> None:
        async with serving() as server:
            clients = [await RtspClient.connect(server.url) for _ in range(MAX_CONNECTIONS)]
            for client in clients:
                assert (await client.set_up(TCP)).status == 200
            reader, writer = await asyncio.open_connection(*server.address)
            refused = parse_answer(await reader.read())
            assert refused.status == 453
            writer.close()
            for client in clients:
                await client.close()

    run(work())


def test_when_the_source_fails_the_server_says_so_and_stays_up() -> None:
    class Broken:
        def newest(self) -> None:
            raise RuntimeError("no camera")

    async def work() -> None:
        async with serving(Broken()) as server:
            client = await RtspClient.connect(server.url)
            await client.set_up(TCP)
            await client.ask("PLAY")
            channel, last = await client.packet()
            assert (channel, GOODBYE in parse_rtcp(last)) == (1, True)
            refused = await client.ask("PLAY")
            assert (refused.status, b"no camera" in refused.body) == (500, True)
            assert isinstance(server.fault, RuntimeError)
            await client.close()

    run(work())


def test_closing_says_goodbye_and_frees_the_port() -> None:
    async def work() -> None:
        async with serving() as server:
            client = await RtspClient.connect(server.url)
            await client.set_up(TCP)
            await client.ask("PLAY")
            await client.picture()
            await server.close()
            last = await client.last_packet()
            assert (last[0], GOODBYE in parse_rtcp(last[1])) == (1, True)
            again = await serve_video(
                Pictures(), port=server.address[1], encoder=EncoderConfig(size_px=SIZE_PX)
            )
            await again.close()
            await client.close()

    run(work())


def test_a_port_that_is_taken_raises() -> None:
    async def work() -> None:
        async with serving() as server:
            port = server.address[1]
            with pytest.raises(PortTakenError, match=rf"video port {port} of 127.0.0.1 is taken"):
                await serve_video(Pictures(), port=port)

    run(work())


def test_an_address_of_another_machine_raises() -> None:
    with pytest.raises(PortTakenError, match=r"has no address 192\.0\.2\.1"):
        run(serve_video(Pictures(), host="192.0.2.1", port=0))


def test_a_port_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="got 70000"):
        run(serve_video(Pictures(), port=70_000))
