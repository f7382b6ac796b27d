"""The RTSP server: from the first open port to the last closed one."""

from __future__ import annotations

import asyncio
import errno
import time
from collections.abc import Callable
from random import Random, SystemRandom
from typing import Final

from sim_bridge.loopback.video.connection import Connection, Studio
from sim_bridge.loopback.video.encoder import EncoderConfig, parameter_sets
from sim_bridge.loopback.video.frame import FrameSource
from sim_bridge.loopback.video.sdp import StreamIdentity
from sim_bridge.loopback.video.streamer import Streamer, VideoStats
from sim_bridge.loopback.video.transport import open_datagram_pair
from uav_bt.errors import DroneError, ValueRangeError

__all__ = ["DEFAULT_PORT", "VideoServer", "serve_video"]

DEFAULT_PORT: Final = 554  # the drone's, and RTSP's

_MAX_PORT: Final = 65_535


class VideoServer:
    """A running server; `serve_video` makes one. Close it in the end."""

    def __init__(self, studio: Studio, listening: asyncio.Server) -> None:
        self._studio = studio
        self._listening = listening
        host, port = listening.sockets[0].getsockname()[:2]
        self._address: tuple[str, int] = (host, port)

    @property
    def address(self) -> tuple[str, int]:
        """The address and the port it listens on."""
        return self._address

    @property
    def url(self) -> str:
        """Where a client finds the video."""
        host, port = self._address
        return f"rtsp://{f'[{host}]' if ':' in host else host}:{port}/live"

    @property
    def media_ports(self) -> tuple[int, int]:
        """The UDP ports that RTP and RTCP come from, where a client wants datagrams."""
        return self._studio.datagrams.ports

    @property
    def fault(self) -> Exception | None:
        """What the source or the encoder raised; None while there is video."""
        return self._studio.fault

    def stats(self) -> VideoStats:
        """Return what was done so far."""
        return self._studio.streamer.stats()

    async def close(self) -> None:
        """Say goodbye to all clients and let go of the ports; safe to call twice."""
        self._listening.close()
        for connection in tuple(self._studio.connections):
            connection.close()
        await self._studio.streamer.close()
        self._studio.datagrams.close()
        for connection in tuple(self._studio.connections):
            connection.abort()
        await self._listening.wait_closed()


async def serve_video(
    source: FrameSource,
    *,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    encoder: EncoderConfig | None = None,
    identity: StreamIdentity | None = None,
    now: Callable[[], float] = time.monotonic,
    random: Random | None = None,
    finish: Callable[[], None] | None = None,
) -> VideoServer:
    """Serve a source's pictures at rtsp://HOST:PORT/live, as an ANAFI does.

    Nothing is fetched or encoded while nobody plays; all who play share one encoder.

    Args:
        source: where pictures come from.
        host: numeric address to listen on; whoever reaches it sees the video.
        port: of RTSP; 0 takes a free one. The media go through two free UDP ports, or through the
            client's connection, as the client wishes.
        encoder: size, rate and quality.
        identity: what clients are told about the sender.
        now: the monotonic clock of the pictures' times.
        random: where streams and sessions begin; unpredictable unless given.
        finish: called once by `close`, on the thread on which the source was asked; for what may
            be let go of only there, such as an OpenGL context.

    Raises:
        DroneError: the port is taken or may not be used.
        MissingDependencyError: this build of PyAV has no x264.
        ValueRangeError: there is no such port.
    """
    if not 0 <= port <= _MAX_PORT:
        raise ValueRangeError(f"a port must lie within 0 and {_MAX_PORT}, got {port}")
    loop = asyncio.get_running_loop()
    config = encoder or EncoderConfig()
    sets = await loop.run_in_executor(None, parameter_sets, config)

    def failed(error: Exception) -> None:
        studio.fault = error
        for connection in tuple(studio.connections):
            connection.tear_down()

    def heard(address: tuple[str, int]) -> None:
        studio.heard(address)

    try:
        datagrams = await open_datagram_pair(host, heard)
    except OSError as error:
        raise _cannot_listen(error, host, port) from error
    studio = Studio(
        streamer=Streamer(source, config, now=now, failed=failed, finish=finish),
        datagrams=datagrams,
        identity=identity or StreamIdentity(),
        sets=sets,
        random=random or SystemRandom(),
        now=now,
    )
    try:
        listening = await loop.create_server(lambda: Connection(studio), host, port)
    except OSError as error:
        datagrams.close()
        raise _cannot_listen(error, host, port) from error
    return VideoServer(studio, listening)


def _cannot_listen(error: OSError, host: str, port: int) -> DroneError:
    where = f"the video's port {port} on {host}"
    if error.errno == errno.EADDRINUSE:
        return DroneError(f"{where} is taken; end what listens there or choose another port")
    if error.errno in {errno.EACCES, errno.EPERM}:
        return DroneError(
            f"{where} may not be used without privileges; choose one of 1024 and above, for "
            "instance 8554"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return DroneError(f"this machine does not have the address {host}; choose one it has")
    return DroneError(f"{where} cannot be used: {error.strerror}")
