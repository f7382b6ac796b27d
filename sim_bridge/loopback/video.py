"""RTSP server of the video: from a client's request to the packets that it is sent."""

from __future__ import annotations

import asyncio
import contextlib
import re
import struct
from collections.abc import Callable, Iterable, Mapping
from secrets import token_hex
from typing import Final

from sim_bridge.loopback.encoder import parameter_sets
from sim_bridge.loopback.handshake import PortTakenError
from sim_bridge.loopback.metadata import VideoFrame
from sim_bridge.loopback.rtsp import (
    CONTROL,
    Request,
    RtspError,
    answer,
    choose_transport,
    describe,
    read_request,
    refusal,
)
from sim_bridge.loopback.streamer import Player, Sink, Streamer

DIRECT_MEDIUM: Final = "Front camera"  # name of the video over the drone's Wi-Fi
REMOTE_MEDIUM: Final = "DefaultVideo"  # name of the video through a remote control, as reported
SESSION_TIMEOUT_S: Final = 60.0  # a client that asks nothing for this time has gone (RFC 2326)

_METHODS: Final = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, GET_PARAMETER, TEARDOWN"
_URL: Final = re.compile(rf"(rtsp://[^/]+/live)(?:/{CONTROL})?/?", re.IGNORECASE)
_LAST_ANSWER_S: Final = 1.0  # time for a client to read the last answer
_MAX_WAITING_BYTES: Final = 256 * 1024  # unsent data of a client; above it, frames are dropped
_PAIR_TRIES: Final = 20  # tries to find an even port with a free neighbour


class VideoServer:
    """Serves video at rtsp://HOST:PORT/live, as an ANAFI does: `open`, `serve`, `close`.

    Frames are fetched and encoded only while a client plays. All clients share one encoder. A
    client chooses whether it is sent UDP packets or packets on its RTSP connection.

    Args:
        newest: returns the newest frame, on a thread of its own; see `Streamer`.
        size_px: width and height of the video, even.
        rate_hz: highest frame rate.
        serial: serial number of the drone.
        now: monotonic clock of the capture times, s.
        media_name: name of the stream.
        finish: called once by `close` on the thread of `newest`, for example to free an OpenGL
            context.

    Raises:
        MissingDependencyError: this build of PyAV has no x264.
        ValueRangeError: width or height is odd.
    """

    def __init__(
        self,
        newest: Callable[[], VideoFrame | None],
        *,
        size_px: tuple[int, int],
        rate_hz: float,
        serial: str,
        now: Callable[[], float],
        media_name: str = DIRECT_MEDIUM,
        finish: Callable[[], None] | None = None,
    ) -> None:
        self.sets = parameter_sets(size_px, rate_hz)
        self.streamer = Streamer(newest, size_px=size_px, rate_hz=rate_hz, now=now, finish=finish)
        self.serial, self.media_name, self.now = serial, media_name, now
        self.udp: tuple[asyncio.DatagramTransport, ...] = ()  # sockets of RTP and RTCP

    async def open(self, host: str) -> None:
        """Bind two UDP ports of a numeric IPv4 address; PortTakenError if there are none."""
        self.udp = await _open_udp(host)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer the requests of one connection until it ends."""
        session = _Session(self, writer)
        try:
            while True:
                async with asyncio.timeout(SESSION_TIMEOUT_S):
                    request = await read_request(reader)
                    writer.write(session.reply(request))
                    await writer.drain()
        except RtspError as error:
            writer.write(refusal(error))
        except EOFError:
            pass  # the client has gone
        finally:
            session.tear_down()
            asyncio.get_running_loop().call_later(_LAST_ANSWER_S, writer.transport.abort)

    async def close(self) -> None:
        """Stop the video and free the UDP ports, after all `serve`; safe to call twice."""
        await self.streamer.close()
        for transport in self.udp:
            transport.close()


class _Session:
    """Session of one client: it sets up a stream, plays and pauses it, and tears it down."""

    def __init__(self, server: VideoServer, writer: asyncio.StreamWriter) -> None:
        self._server = server
        self._writer = writer
        self._name = token_hex(8)
        self._player: Player | None = None  # None: no stream is set up

    def reply(self, request: Request) -> bytes:
        """Execute a request and return its answer."""
        sequence = request.headers.get("cseq", "")
        if not sequence.isdecimal():
            return refusal(RtspError(400, "expected a number in the header CSeq"))
        try:
            headers, body = self._execute(request)
        except RtspError as error:
            return refusal(error, sequence)
        return answer(200, sequence, headers, body)

    def _execute(self, request: Request) -> tuple[Mapping[str, str], str]:
        """Return headers and body of the answer."""
        if request.method in {"OPTIONS", "GET_PARAMETER"}:  # either keeps a session alive
            return {"Public": _METHODS}, ""
        url = _URL.fullmatch(request.url)
        if url is None:
            raise RtspError(404, "expected rtsp://ADDRESS/live")
        match request.method:
            case "DESCRIBE":
                headers = {"Content-Base": f"{url[1]}/", "Content-Type": "application/sdp"}
                return headers, self._description()
            case "SETUP":
                return self._set_up(request), ""
            case "PLAY":
                return self._play(self._prepared(request), url[1]), ""
            case "PAUSE":
                self._server.streamer.remove(self._prepared(request))
            case "TEARDOWN":
                self._prepared(request)
                self.tear_down()
            case _:
                raise RtspError(501, f"expected one of {_METHODS}")
        return {"Session": self._name}, ""

    def _description(self) -> str:
        """Return the SDP."""
        return describe(
            self._server.sets,
            serial=self._server.serial,
            media_name=self._server.media_name,
            host=self._writer.get_extra_info("sockname")[0],
            session=round(1e6 * self._server.now()),
        )

    def _set_up(self, request: Request) -> Mapping[str, str]:
        """Prepare a stream, which replaces an earlier one."""
        tcp, pair = choose_transport(request.headers.get("transport", ""))
        self.tear_down()
        sink: Sink
        if tcp:
            sink = _TcpSink(self._writer.transport, pair)
            chosen = f"RTP/AVP/TCP;unicast;interleaved={pair[0]}-{pair[1]}"
        else:
            udp, host = self._server.udp, self._writer.get_extra_info("peername")[0]
            sink = _UdpSink(udp, host, pair)
            ports = "-".join(str(one.get_extra_info("sockname")[1]) for one in udp)
            chosen = f"RTP/AVP;unicast;client_port={pair[0]}-{pair[1]};server_port={ports}"
        self._player = Player(self._server.serial, sink)
        return {
            "Transport": f"{chosen};ssrc={self._player.stream.ssrc:08X}",
            "Session": f"{self._name};timeout={SESSION_TIMEOUT_S:.0f}",
        }

    def _play(self, player: Player, url: str) -> Mapping[str, str]:
        if (fault := self._server.streamer.fault) is not None:
            raise RtspError(500, f"the video has ended: {fault}")
        self._server.streamer.add(player)
        sequence, stamp = player.stream.next_sequence, player.stream.stamp(self._server.now())
        info = f"url={url}/{CONTROL};seq={sequence};rtptime={stamp}"
        return {"Session": self._name, "RTP-Info": info}

    def _prepared(self, request: Request) -> Player:
        """Return the stream that was set up, if the request names its session."""
        named = request.headers.get("session", "").partition(";")[0]
        if self._player is None or named != self._name:
            raise RtspError(454, "expected the session that SETUP returned on this connection")
        return self._player

    def tear_down(self) -> None:
        """End the stream, if there is one, with a BYE packet."""
        if self._player is not None:
            self._server.streamer.remove(self._player)
            self._player.goodbye(self._server.now())
            self._player = None


class _TcpSink:
    """Packets on the RTSP connection of a client, on one channel for RTP and one for RTCP."""

    def __init__(self, transport: asyncio.WriteTransport, channels: tuple[int, int]) -> None:
        self._transport = transport
        self._channels = channels

    @property
    def congested(self) -> bool:
        """Whether the client reads too slowly."""
        return self._transport.get_write_buffer_size() > _MAX_WAITING_BYTES

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""
        self._transport.write(b"".join(self._framed(0, packet) for packet in packets))

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""
        self._transport.write(self._framed(1, packet))

    def _framed(self, kind: int, packet: bytes) -> bytes:
        return struct.pack("!cBH", b"$", self._channels[kind], len(packet)) + packet


class _UdpSink:
    """Packets from the two sockets of the server to two ports of a client, for RTP and RTCP."""

    congested = False  # packets are lost instead

    def __init__(
        self, udp: tuple[asyncio.DatagramTransport, ...], host: str, ports: tuple[int, int]
    ) -> None:
        self._data, self._control = udp
        self._addresses = [(host, port) for port in ports]

    def send_data(self, packets: Iterable[bytes]) -> None:
        """Send RTP packets."""
        for packet in packets:
            self._data.sendto(packet, self._addresses[0])

    def send_control(self, packet: bytes) -> None:
        """Send an RTCP packet."""
        self._control.sendto(packet, self._addresses[1])


async def _open_udp(host: str) -> tuple[asyncio.DatagramTransport, asyncio.DatagramTransport]:
    """Open an even UDP port and the next one, as RTP requires."""
    endpoint = asyncio.get_running_loop().create_datagram_endpoint
    for _ in range(_PAIR_TRIES):
        data, _protocol = await endpoint(asyncio.DatagramProtocol, local_addr=(host, 0))
        port = data.get_extra_info("sockname")[1]
        if port % 2 == 0:
            with contextlib.suppress(OSError):  # the neighbour is taken: try the next pair
                control, _protocol = await endpoint(
                    asyncio.DatagramProtocol, local_addr=(host, port + 1)
                )
                return data, control
        data.close()
    raise PortTakenError(
        f"found no two neighbouring free UDP ports on {host} in {_PAIR_TRIES} tries; end some "
        "programs that listen there"
    )
