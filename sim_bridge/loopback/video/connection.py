"""RTSP connection of one client: answers requests and executes them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Final, cast

from sim_bridge.loopback.video.dialogue import Dialogue, describe, refusal
from sim_bridge.loopback.video.encoder import ParameterSets
from sim_bridge.loopback.video.rtp import RtpStream
from sim_bridge.loopback.video.rtsp_message import RequestReader, RtspError
from sim_bridge.loopback.video.streamer import Player, Streamer
from sim_bridge.loopback.video.transport import (
    DatagramPair,
    DatagramSink,
    InterleavedSink,
    Sink,
    Transport,
)

_LOG: Final = logging.getLogger(__name__)

MAX_CONNECTIONS: Final = 32  # far above normal use; more is a fault or an attack
_MAX_UNREAD_BYTES: Final = 1024 * 1024  # limit of answers that a client does not read
_LAST_ANSWER_S: Final = 1.0  # time for a client to read the last answer


@dataclass(kw_only=True)
class ServerState:
    """Shared state of all connections."""

    streamer: Streamer
    datagrams: DatagramPair
    serial: str  # serial number of the drone
    media_name: str  # name of the stream
    sets: ParameterSets
    random: Random
    now: Callable[[], float]  # monotonic clock of the capture times, s
    session_timeout_s: float  # longest silence of a client
    fault: Exception | None = None  # the error that ended the video; None while it works
    connections: set[Connection] = field(default_factory=set)
    # By source address of the RTCP reports; a report keeps its session alive.
    reporting: dict[tuple[str, int], Connection] = field(default_factory=dict)


class Connection(asyncio.Protocol):
    """Serves one client; the session ends with the connection.

    Args:
        state: shared state of all connections.
    """

    def __init__(self, state: ServerState) -> None:
        self._state = state
        self._reader = RequestReader()
        self._dialogue = Dialogue(self, state.random, timeout_s=state.session_timeout_s)
        self._transport: asyncio.Transport
        self._host = ""  # address of the client
        self._player: Player | None = None
        self._report_address: tuple[str, int] | None = None
        self._received_s = 0.0
        self._timer: asyncio.TimerHandle | None = None

    # --- asyncio's side ---

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Accept a client, or refuse it if there are too many."""
        self._transport = cast("asyncio.Transport", transport)
        peer = self._transport.get_extra_info("peername")
        if peer is None:  # already disconnected, for example a port scanner
            self._transport.abort()
            return
        if len(self._state.connections) >= MAX_CONNECTIONS and not self._make_room():
            self._end(RtspError(453, f"at most {MAX_CONNECTIONS} clients are served at once"))
            return
        self._host = peer[0]
        self._state.connections.add(self)
        self.touch()
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Answer all complete requests."""
        if self._transport.is_closing():
            return
        self.touch()
        try:
            for request in self._reader.feed(data):
                self._transport.write(self._dialogue.reply(request))
        except RtspError as error:
            self._end(error)
            return
        if self._transport.get_write_buffer_size() > _MAX_UNREAD_BYTES:
            _LOG.warning("client %s reads no answers; its connection is ended", self._host)
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  (asyncio's interface)
        """Remove the client."""
        self._state.connections.discard(self)
        self._forget()
        if self._timer is not None:
            self._timer.cancel()

    @property
    def idle_since_s(self) -> float | None:
        """Time of the last data from the client; None while it has a stream."""
        return None if self._player is not None else self._received_s

    def touch(self) -> None:
        """Restart the timeout of the client."""
        self._received_s = asyncio.get_running_loop().time()

    def close(self) -> None:
        """Send a BYE packet and end the connection."""
        self.tear_down()
        self._transport.close()

    def abort(self) -> None:
        """End the connection at once; sent data may remain unread."""
        self._transport.abort()

    # --- the effects of requests ---

    def description(self) -> str:
        """Return the SDP."""
        return describe(
            self._state.sets,
            serial=self._state.serial,
            media_name=self._state.media_name,
            host=self._transport.get_extra_info("sockname")[0],
            session=round(1e6 * self._state.now()),
        )

    def set_up(self, transport: Transport) -> str:
        """Prepare a stream; it replaces an earlier one."""
        self._forget()
        stream = RtpStream(self._state.random, self._state.serial)
        self._player = Player(stream, self._sink(transport))
        return transport.header(self._state.datagrams.ports, stream.ssrc)

    def _sink(self, transport: Transport) -> Sink:
        if transport.channels is not None:
            return InterleavedSink(self._transport, transport.channels)
        ports = transport.ports or (0, 0)
        self._report_address = (self._host, ports[1])
        self._state.reporting[self._report_address] = self
        return DatagramSink(self._state.datagrams, self._host, ports)

    def play(self) -> tuple[int, int]:
        """Start sending."""
        if self._state.fault is not None:
            raise RtspError(500, f"the video has ended: {self._state.fault}")
        player = self._playing()
        self._state.streamer.add(player)
        return player.stream.next_sequence, player.stream.stamp(self._state.now())

    def pause(self) -> None:
        """Stop sending."""
        self._state.streamer.remove(self._playing())

    def tear_down(self) -> None:
        """Send a BYE packet and remove the stream."""
        if self._player is not None:
            self._player.goodbye(self._state.now())
        self._forget()

    # --- helpers ---

    def _playing(self) -> Player:
        if self._player is None:
            raise RtspError(454, "no stream is set up; send SETUP first")
        return self._player

    def _forget(self) -> None:
        if self._player is not None:
            self._state.streamer.remove(self._player)
            self._player = None
        if self._report_address is not None:
            if self._state.reporting.get(self._report_address) is self:
                del self._state.reporting[self._report_address]
            self._report_address = None

    def _end(self, error: RtspError) -> None:
        """Send an error and end the connection."""
        self._forget()
        self._transport.write(refusal(error, ""))
        self._transport.close()
        self._abort_after(_LAST_ANSWER_S)

    def _wait(self) -> None:
        loop = asyncio.get_running_loop()
        left_s = self._received_s + self._state.session_timeout_s - loop.time()
        if left_s <= 0.0:
            _LOG.info("client %s has timed out", self._host)
            self.close()
            self._abort_after(_LAST_ANSWER_S)
        else:
            self._timer = loop.call_later(left_s, self._wait)

    def _make_room(self) -> bool:
        """End the longest silent connection without a stream; return whether one was found."""
        idle = [each for each in self._state.connections if each.idle_since_s is not None]
        if idle:
            longest = min(idle, key=lambda each: each.idle_since_s or 0.0)
            self._state.connections.discard(longest)
            longest.abort()
        return bool(idle)

    def _abort_after(self, duration_s: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(duration_s, self._transport.abort)
