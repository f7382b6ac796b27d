"""One client's RTSP connection: bytes in, answers out, and the effects of its requests."""

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

MAX_CONNECTIONS: Final = 32  # a drone serves a handful; more is a fault or malice
_MAX_UNREAD_BYTES: Final = 1024 * 1024  # answers that a client asks for and does not read
_LAST_ANSWER_S: Final = 1.0  # for a client to read the answer that ends its connection


@dataclass(kw_only=True)
class ServerState:
    """What all connections share."""

    streamer: Streamer
    datagrams: DatagramPair
    serial: str  # of the drone
    media_name: str  # what the stream is called
    sets: ParameterSets
    random: Random
    now: Callable[[], float]  # monotonic, the clock of the frames' times
    session_timeout_s: float  # without anything from a client
    fault: Exception | None = None  # why there is no video any more
    connections: set[Connection] = field(default_factory=set)
    # By the address that RTCP reports come from: a report keeps its session alive.
    reporting: dict[tuple[str, int], Connection] = field(default_factory=dict)


class Connection(asyncio.Protocol):
    """Serves one client; its session ends with its connection.

    Args:
        state: what it shares with the others.
    """

    def __init__(self, state: ServerState) -> None:
        self._state = state
        self._reader = RequestReader()
        self._dialogue = Dialogue(self, state.random, timeout_s=state.session_timeout_s)
        self._transport: asyncio.Transport
        self._host = ""  # the client's
        self._player: Player | None = None
        self._report_address: tuple[str, int] | None = None
        self._received_s = 0.0
        self._timer: asyncio.TimerHandle | None = None

    # --- asyncio's side ---

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Accept a client, or refuse it where there are too many."""
        self._transport = cast("asyncio.Transport", transport)
        peer = self._transport.get_extra_info("peername")
        if peer is None:  # gone already, as port scanners are
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
        """Answer all requests that are complete."""
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
        """Forget the client."""
        self._state.connections.discard(self)
        self._forget()
        if self._timer is not None:
            self._timer.cancel()

    @property
    def idle_since_s(self) -> float | None:
        """When the client was heard last; None while it has a stream."""
        return None if self._player is not None else self._received_s

    def touch(self) -> None:
        """Note that the client is alive."""
        self._received_s = asyncio.get_running_loop().time()

    def close(self) -> None:
        """Send a BYE packet and end the connection."""
        self.tear_down()
        self._transport.close()

    def abort(self) -> None:
        """End the connection without waiting for the client to read what was sent."""
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
        """Prepare a stream in place of an earlier one."""
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
        """Begin to send."""
        if self._state.fault is not None:
            raise RtspError(500, f"there is no video: {self._state.fault}")
        player = self._playing()
        self._state.streamer.add(player)
        return player.stream.next_sequence, player.stream.stamp(self._state.now())

    def pause(self) -> None:
        """Stop sending."""
        self._state.streamer.remove(self._playing())

    def tear_down(self) -> None:
        """Send a BYE packet and forget the stream."""
        if self._player is not None:
            self._player.goodbye(self._state.now())
        self._forget()

    # --- helpers ---

    def _playing(self) -> Player:
        if self._player is None:
            raise RtspError(454, "there is no stream; SETUP comes first")
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
        """Refuse what came and hang up."""
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
        """End the connection without a stream that was silent for longest, if there is one."""
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
