"""RTSP server of the video."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from random import Random, SystemRandom
from typing import Final

from sim_bridge.loopback.handshake import Identity, port_error
from sim_bridge.loopback.video.connection import Connection, ServerState
from sim_bridge.loopback.video.dialogue import DIRECT_MEDIUM
from sim_bridge.loopback.video.encoder import EncoderConfig, parameter_sets
from sim_bridge.loopback.video.frame import FrameSource
from sim_bridge.loopback.video.streamer import Streamer, VideoStats
from sim_bridge.loopback.video.transport import open_datagram_pair
from uav_bt.errors import ValueRangeError

_MAX_PORT: Final = 65_535


class VideoServer:
    """A running server, made by `serve_video`. Close it at the end.

    Args:
        state: shared state of the connections.
        listening: the RTSP socket.
    """

    def __init__(self, state: ServerState, listening: asyncio.Server) -> None:
        self._state = state
        self._listening = listening
        host, port = listening.sockets[0].getsockname()[:2]
        self.address: tuple[str, int] = (host, port)  # address and port of the RTSP socket

    @property
    def url(self) -> str:
        """The URL of the video."""
        host, port = self.address
        return f"rtsp://{f'[{host}]' if ':' in host else host}:{port}/live"

    @property
    def fault(self) -> Exception | None:
        """The error of the source or the encoder; None while the video works."""
        return self._state.fault

    def stats(self) -> VideoStats:
        """Return the statistics since the start."""
        return self._state.streamer.stats()

    async def close(self) -> None:
        """End all sessions and free the ports; safe to call twice."""
        self._listening.close()
        for connection in tuple(self._state.connections):
            connection.close()
        await self._state.streamer.close()
        self._state.datagrams.close()
        for connection in tuple(self._state.connections):
            connection.abort()
        await self._listening.wait_closed()


async def serve_video(
    source: FrameSource,
    *,
    host: str = "127.0.0.1",
    port: int = 554,
    encoder: EncoderConfig | None = None,
    serial: str = Identity().serial,
    media_name: str = DIRECT_MEDIUM,
    now: Callable[[], float] = time.monotonic,
    random: Random | None = None,
    finish: Callable[[], None] | None = None,
    session_timeout_s: float = 60.0,  # the default of RFC 2326
) -> VideoServer:
    """Serve the frames of a source at rtsp://HOST:PORT/live, as an ANAFI does.

    Frames are fetched and encoded only while a client plays. All clients share one encoder.

    Args:
        source: source of the frames.
        host: numeric address to listen on; the video has no access control.
        port: RTSP port; 0 selects a free one. The client chooses whether the media use two free UDP
            ports or its RTSP connection.
        encoder: size, rate and quality.
        serial: serial number of the drone.
        media_name: name of the stream.
        now: monotonic clock of the capture times, s.
        random: source of the first numbers of streams and sessions; unpredictable by default.
        finish: called once by `close` on the thread of the source, for example to free an OpenGL
            context.
        session_timeout_s: a client that is silent for this time is disconnected, s.

    Raises:
        PortTakenError: the port is taken or may not be used.
        MissingDependencyError: this build of PyAV has no x264.
        ValueRangeError: the port number is out of range.
    """
    if not 0 <= port <= _MAX_PORT:
        raise ValueRangeError(f"a port must lie within 0 and {_MAX_PORT}, got {port}")
    loop = asyncio.get_running_loop()
    config = encoder or EncoderConfig()
    sets = await loop.run_in_executor(None, parameter_sets, config)

    def failed(error: Exception) -> None:
        state.fault = error
        for connection in tuple(state.connections):
            connection.tear_down()

    def report_received(address: tuple[str, int]) -> None:
        if (connection := state.reporting.get(address)) is not None:
            connection.touch()

    try:
        datagrams = await open_datagram_pair(host, report_received)
    except OSError as error:
        raise port_error(error, host, port, "video") from error
    state = ServerState(
        streamer=Streamer(source, config, now=now, failed=failed, finish=finish),
        datagrams=datagrams,
        serial=serial,
        media_name=media_name,
        sets=sets,
        random=random or SystemRandom(),
        now=now,
        session_timeout_s=session_timeout_s,
    )
    try:
        listening = await loop.create_server(lambda: Connection(state), host, port)
    except OSError as error:
        datagrams.close()
        raise port_error(error, host, port, "video") from error
    return VideoServer(state, listening)
