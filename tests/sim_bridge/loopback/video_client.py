"""Test client of the video: pictures, RTSP, RTP, RTCP."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.metadata import NorthEastDown, VideoFrame
from sim_bridge.loopback.server import LoopbackServer
from sim_bridge.loopback.video import VideoServer
from sim_bridge.loopback.world import Location
from tests.sim_bridge.loopback.loopback_client import HOST, serving
from uav_bt.types import Attitude, FlyingState

SIZE_PX = (64, 48)
TCP = "RTP/AVP/TCP;unicast;interleaved=0-1"
# Quadrants: top left, top right, bottom left, bottom right.
COLOURS = np.array([(200, 30, 60), (30, 60, 210), (20, 180, 90), (240, 220, 20)], np.uint8)
NOW_S = 100.0  # constant time of the server's clock
BYE = 203  # type of an RTCP packet

# An image of four colours shows mirroring and swapped channels.
FRAME = VideoFrame(
    image=COLOURS.reshape(2, 2, 3).repeat(SIZE_PX[1] // 2, axis=0).repeat(SIZE_PX[0] // 2, axis=1),
    captured_s=12.5,
    captured_utc_s=1_700_000_000.25,
    attitude=Attitude(roll_rad=0.1, pitch_rad=-0.2, yaw_rad=1.5),
    camera=Attitude(pitch_rad=-0.5, yaw_rad=1.5),
    velocity_mps=NorthEastDown(north=1.0, east=2.0, down=-0.5),
    position_m=NorthEastDown(north=3.0, east=-4.0, down=-1.5),
    location=Location(latitude_deg=48.8789, longitude_deg=2.36778, altitude_m=100.0),
    altitude_m=1.5,
    height_m=1.25,
    battery=0.87,
    flying=FlyingState.HOVERING,
    fov_rad=(1.25, 0.75),
)


def frame_at(captured_s: float) -> VideoFrame:
    """Return the frame of four colours with another time."""
    return replace(FRAME, captured_s=captured_s)


def assert_quadrants(image: NDArray[Any]) -> None:
    """Check the colours at the centres of the quadrants."""
    height, width = image.shape[:2]
    centres = image[height // 4 :: height // 2, width // 4 :: width // 2].reshape(-1, 3)
    assert np.abs(centres.astype(int) - COLOURS).max() <= 6


class Pictures:
    """A source with a new frame at each call, 1/30 s after the last one."""

    asked = 0

    def newest(self) -> VideoFrame | None:
        self.asked += 1
        return frame_at(NOW_S + self.asked / 30.0)


class Answer(NamedTuple):
    """A parsed answer."""

    status: int
    headers: dict[str, str]
    body: str


@dataclass
class RtspClient:
    """One connection to the server; stores the packets that come on it."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    url: str
    number: int = 0
    session: str = ""
    waiting: list[Any] = field(default_factory=list)  # channels and packets

    async def ask(self, method: str, url: str = "", **headers: str) -> Answer:
        """Send a request and return its answer."""
        self.number += 1
        lines = [f"{method} {url or self.url} RTSP/1.0"]
        headers = {"CSeq": str(self.number), "Session": self.session} | headers
        lines += [f"{name}: {value}" for name, value in headers.items() if value]
        self.writer.write("\r\n".join([*lines, "", ""]).encode())
        while not isinstance(found := await self._message(), Answer):
            self.waiting.append(found)
        if "session" in found.headers:
            self.session = found.headers["session"].partition(";")[0]
        return found

    async def play(self, transport: str = TCP) -> Answer:
        """Set up the stream and play it."""
        set_up = await self.ask("SETUP", f"{self.url}/stream=0", Transport=transport)
        assert (await self.ask("PLAY")).status == 200
        return set_up

    async def packet(self) -> tuple[int, bytes]:
        """Return the next packet on the connection and its channel."""
        channel, data = self.waiting.pop(0) if self.waiting else await self._message()
        return channel, data

    async def picture(self) -> list[RtpPacket]:
        """Return the packets of the next frame; reports between them are skipped."""
        packets: list[RtpPacket] = []
        while not packets or not packets[-1].marker:
            channel, data = await self.packet()
            packets += [parse_rtp(data)] if channel == 0 else []
        return packets

    async def goodbye(self) -> bool:
        """Read to the end of the connection; return whether a BYE came last."""
        last = 0, b""
        try:
            while True:
                last = await self.packet()
        except asyncio.IncompleteReadError:
            return last[0] == 1 and BYE in parse_rtcp(last[1])

    async def _message(self) -> Any:
        first = await self.reader.readexactly(1)
        if first == b"$":
            channel, size = struct.unpack("!BH", await self.reader.readexactly(3))
            return channel, await self.reader.readexactly(size)
        head = first + await self.reader.readuntil(b"\r\n\r\n")
        status, *lines = head.decode().rstrip().split("\r\n")
        headers = {name.lower(): value for name, value in (line.split(": ", 1) for line in lines)}
        body = await self.reader.readexactly(int(headers.get("content-length", "0")))
        return Answer(int(status.split()[1]), headers, body.decode())


class Served(NamedTuple):
    """A server and its video."""

    server: LoopbackServer
    video: VideoServer


@asynccontextmanager
async def visiting(served: Served) -> AsyncIterator[RtspClient]:
    """Yield a client of the server."""
    port = served.server.ports.rtsp
    reader, writer = await asyncio.open_connection(HOST, port)
    yield RtspClient(reader, writer, f"rtsp://{HOST}:{port}/live")
    writer.close()


@asynccontextmanager
async def watched(
    newest: Callable[[], VideoFrame | None] | None = None, *, plays: bool = True, **options: Any
) -> AsyncIterator[tuple[Served, RtspClient]]:
    """Yield a server of the video and a client that plays it."""
    how: dict[str, Any] = {"size_px": SIZE_PX, "rate_hz": 120.0, "now": lambda: NOW_S}
    video = VideoServer(newest or Pictures().newest, serial="PI9", **how, **options)
    async with serving(video=video) as server, visiting(Served(server, video)) as client:
        if plays:
            await client.play()
        yield Served(server, video), client


class RtpPacket(NamedTuple):
    """A parsed packet."""

    marker: bool
    kind: int
    sequence: int
    stamp: int
    ssrc: int
    metadata: bytes | None  # the message in Parrot's header extension
    payload: bytes


def parse_rtp(data: bytes) -> RtpPacket:
    """Parse an RTP packet (RFC 3550, section 5.1)."""
    flags, kind, sequence, stamp, ssrc = struct.unpack_from("!BBHII", data)
    assert flags & 0xEF == 0x80, "version 2, no padding, no contributing sources"
    metadata, begin = None, 12
    if flags & 0x10:
        number, words, word, offset = struct.unpack_from("!4H", data, 12)
        assert (number, word >> 2, offset) == (0x5062, 0, 0), "a message of one part"
        begin = 16 + 4 * words
        metadata = data[20 : begin - (word & 3)]
    return RtpPacket(bool(kind & 0x80), kind & 0x7F, sequence, stamp, ssrc, metadata, data[begin:])


def units_of(packets: list[RtpPacket]) -> tuple[bytes, ...]:
    """Return the NAL units of packets (RFC 6184), as a receiver does."""
    units: list[bytes] = []
    unfinished = False  # whether more fragments of the last unit must follow
    for payload in (packet.payload for packet in packets):
        if payload[0] & 0x1F != 28:
            assert not unfinished
            units.append(payload)
            continue
        begins, ends = bool(payload[1] & 0x80), bool(payload[1] & 0x40)
        assert begins is not unfinished
        assert not (begins and ends), "a unit in one fragment is not allowed"
        if begins:
            units.append(bytes([payload[0] & 0xE0 | payload[1] & 0x1F]))
        units[-1] += payload[2:]
        unfinished = not ends
    assert not unfinished
    return tuple(units)


def parse_rtcp(data: bytes) -> dict[int, bytes]:
    """Return the bodies of a compound packet's parts by their type."""
    parts = {}
    while data:
        flags, kind, words = struct.unpack_from("!BBH", data)
        assert flags & 0xE0 == 0x80
        assert len(data) >= 4 + 4 * words
        parts[kind] = data[4 : 4 + 4 * words]
        data = data[4 + 4 * words :]
    return parts
