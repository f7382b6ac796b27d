"""Test client of the video: images, RTP, RTSP, protobuf."""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Coroutine, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.video.frame import VideoFrame

PATIENCE_S = 10.0  # timeout of a test, s
SIZE_PX = (64, 48)
# Quadrants: top left, top right, bottom left, bottom right.
COLOURS = ((200, 30, 60), (30, 60, 210), (20, 180, 90), (240, 220, 20))

T = TypeVar("T")


def quadrants(size_px: tuple[int, int] = SIZE_PX) -> NDArray[np.uint8]:
    """Return an image of four colours, which shows mirroring and swapped channels."""
    width, height = size_px
    corners = np.array(COLOURS, np.uint8).reshape(2, 2, 3)
    return corners.repeat(height // 2, axis=0).repeat(width // 2, axis=1)


def centres(image: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the colours at the centres of the quadrants, (4, 3)."""
    height, width = image.shape[:2]
    rows, columns = (height // 4, 3 * height // 4), (width // 4, 3 * width // 4)
    return np.array([image[row, column] for row in rows for column in columns], np.int64)


def run(work: Coroutine[Any, Any, T]) -> T:
    """Run the coroutine of a test, with a timeout."""
    return asyncio.run(asyncio.wait_for(work, PATIENCE_S))


def seeded(seed: int) -> Random:
    """Return a reproducible source of random numbers."""
    return Random(seed)  # noqa: S311  (nothing here is a secret)


class Pictures:
    """A source with a new frame at each call, 1/30 s after the last one."""

    def __init__(self) -> None:
        self.asked = 0

    def newest(self) -> VideoFrame:
        self.asked += 1
        return VideoFrame(image=quadrants(), captured_s=100.0 + self.asked / 30.0)


# --- RTP ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RtpPacket:
    """A parsed packet."""

    marker: bool
    kind: int
    sequence: int
    stamp: int
    ssrc: int
    extension: tuple[int, bytes] | None  # id and content
    payload: bytes


def parse_rtp(data: bytes) -> RtpPacket:
    """Parse an RTP packet (RFC 3550, section 5.1)."""
    flags, kind, sequence, stamp, ssrc = struct.unpack_from("!BBHII", data)
    assert flags & 0xEF == 0x80, "version 2, no padding, no contributing sources"
    extension, begin = None, 12
    if flags & 0x10:
        number, words = struct.unpack_from("!HH", data, 12)
        begin = 16 + 4 * words
        extension = (number, data[16:begin])
    marker, kind = bool(kind & 0x80), kind & 0x7F
    return RtpPacket(marker, kind, sequence, stamp, ssrc, extension, data[begin:])


def unpack_metadata(content: bytes) -> bytes:
    """Return the message in Parrot's header extension, which must have one part."""
    word, offset = struct.unpack_from("!HH", content)
    assert (word >> 9, word >> 2 & 0x7F, offset) == (0, 0, 0)
    return content[4 : len(content) - (word & 3)]


def reassemble(payloads: Iterable[bytes]) -> tuple[bytes, ...]:
    """Return the NAL units of payloads (RFC 6184), as a receiver does."""
    units: list[bytes] = []
    part: bytearray | None = None
    for payload in payloads:
        kind = payload[0] & 0x1F
        assert (kind == 28) or part is None, "a fragmented unit was not finished"
        if kind == 24:
            units += _aggregated(payload[1:])
        elif kind == 28:
            begins, ends = bool(payload[1] & 0x80), bool(payload[1] & 0x40)
            assert begins == (part is None)
            assert not (begins and ends), "a unit in one fragment is not allowed"
            if begins:
                part = bytearray([payload[0] & 0xE0 | payload[1] & 0x1F])
            assert part is not None
            part += payload[2:]
            if ends:
                units.append(bytes(part))
                part = None
        else:
            units.append(payload)
    assert part is None
    return tuple(units)


def _aggregated(data: bytes) -> Iterator[bytes]:
    while data:
        size = int.from_bytes(data[:2], "big")
        assert 0 < size <= len(data) - 2
        yield data[2 : 2 + size]
        data = data[2 + size :]


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


# --- protobuf -------------------------------------------------------------------------------------


def fields(data: bytes) -> dict[int, Any]:
    """Return the fields of a message by number: ints for varints, otherwise bytes."""
    found: dict[int, Any] = {}
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        size = {1: 8, 5: 4}.get(tag & 7)
        if tag & 7 == 0:
            found[tag >> 3], at = _varint(data, at)
            continue
        if size is None:
            size, at = _varint(data, at)
        found[tag >> 3] = data[at : at + size]
        at += size
    assert at == len(data)
    return found


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while data[at] & 0x80:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | data[at] << shift, at + 1


# --- RTSP -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """A parsed answer."""

    status: int
    headers: dict[str, str]
    body: bytes


def parse_answer(data: bytes) -> Answer:
    """Parse a complete answer."""
    head, _, body = data.partition(b"\r\n\r\n")
    first, *lines = head.decode().split("\r\n")
    version, status, _reason = first.split(" ", 2)
    assert version == "RTSP/1.0"
    headers = {name.lower(): value for name, value in (line.split(": ", 1) for line in lines)}
    assert int(headers.get("content-length", "0")) == len(body)
    return Answer(int(status), headers, body)


@dataclass
class RtspClient:
    """One connection to the server."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    url: str
    number: int = 0
    session: str = ""
    waiting: list[tuple[int, bytes]] = field(default_factory=list)  # channels and packets
    reports: list[bytes] = field(default_factory=list)  # reports between the packets of a frame

    @classmethod
    async def connect(cls, url: str) -> RtspClient:
        host, _, port = url.removeprefix("rtsp://").partition("/")[0].rpartition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        return cls(reader, writer, url)

    async def ask(self, method: str, url: str = "", body: bytes = b"", **headers: str) -> Answer:
        """Send a request and return its answer; earlier packets are kept."""
        self.number += 1
        lines = [f"{method} {url or self.url} RTSP/1.0", f"CSeq: {self.number}"]
        if self.session:
            lines.append(f"Session: {self.session}")
        lines += [f"{name}: {value}" for name, value in headers.items()]
        if body:
            lines.append(f"Content-Length: {len(body)}")
        self.writer.write("\r\n".join([*lines, "", ""]).encode() + body)
        while not isinstance(found := await self._message(), Answer):
            self.waiting.append(found)
        assert found.headers["cseq"] == str(self.number)
        return found

    async def set_up(self, transport: str) -> Answer:
        """Set up the stream and store the session."""
        answer = await self.ask("SETUP", f"{self.url}/stream=0", Transport=transport)
        self.session = answer.headers.get("session", "").partition(";")[0]
        return answer

    async def packet(self) -> tuple[int, bytes]:
        """Return the next interleaved packet and its channel."""
        if self.waiting:
            return self.waiting.pop(0)
        found = await self._message()
        assert not isinstance(found, Answer)
        return found

    async def last_packet(self) -> tuple[int, bytes]:
        """Return the last packet before the server disconnects."""
        last = await self.packet()
        with contextlib.suppress(asyncio.IncompleteReadError):
            while True:
                last = await self.packet()
        return last

    async def picture(self) -> list[RtpPacket]:
        """Return the packets of one frame from the connection."""
        return await collect(self._data)

    async def _data(self) -> bytes:
        while True:
            channel, data = await self.packet()
            if channel == 0:
                return data
            self.reports.append(data)

    async def _message(self) -> Answer | tuple[int, bytes]:
        first = await self.reader.readexactly(1)
        if first == b"$":
            channel, size = struct.unpack("!BH", await self.reader.readexactly(3))
            return channel, await self.reader.readexactly(size)
        head = first + await self.reader.readuntil(b"\r\n\r\n")
        size = next(
            (int(line.split(b":")[1]) for line in head.split(b"\r\n") if b"Content-Length" in line),
            0,
        )
        return parse_answer(head + await self.reader.readexactly(size))

    async def close(self) -> None:
        self.writer.close()
        await self.writer.wait_closed()


async def collect(receive: Any) -> list[RtpPacket]:
    """Return the packets of one frame."""
    packets = [parse_rtp(await receive())]
    while not packets[-1].marker:
        packets.append(parse_rtp(await receive()))
    return packets


class Inbox(asyncio.DatagramProtocol):
    """Datagrams in the order of their arrival."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[bytes] = asyncio.Queue()

    def datagram_received(self, data: bytes, _addr: tuple[str, int]) -> None:
        self.queue.put_nowait(data)


async def open_inbox() -> tuple[asyncio.DatagramTransport, Inbox, int]:
    """Open a free UDP port on this machine."""
    loop = asyncio.get_running_loop()
    transport, inbox = await loop.create_datagram_endpoint(Inbox, local_addr=("127.0.0.1", 0))
    return transport, inbox, transport.get_extra_info("sockname")[1]


def decodable(nals: Sequence[bytes]) -> bytes:
    """Return NAL units as a stream with start codes."""
    return b"".join(b"\x00\x00\x00\x01" + unit for unit in nals)
