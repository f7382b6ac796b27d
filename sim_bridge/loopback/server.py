"""Network server of a loopback ANAFI: discovery, command link and web server."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from sim_bridge.loopback.codec import WireError, decode
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import (
    MAX_REQUEST_BYTES,
    ConnectionRequest,
    Identity,
    Ports,
    accepted,
    announcement,
    port_error,
    read_request,
    refused,
)
from sim_bridge.loopback.link import Link, LinkTiming
from sim_bridge.loopback.listener import Listener, Service
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.messages import Buffer, MessageTable, MessageType
from sim_bridge.loopback.web import serve_web
from uav_bt.errors import DroneError, InputError

_LOG = logging.getLogger(__name__)

# A remote control has the web server of its drone at this distance above the drone's port: Parrot's
# libarsdk connects to 180 in place of 80.
_DRONE_BEHIND: Final = 100


@dataclass(frozen=True, kw_only=True)
class ServerOptions:
    """Address, identity and timing of a server."""

    address: str = "127.0.0.1"  # the default is reachable from this machine only
    ports: Ports = field(default_factory=Ports)
    identity: Identity = field(default_factory=Identity)
    timing: LinkTiming = field(default_factory=LinkTiming)
    update_s: float = 0.02  # s between two updates of the firmware
    probe_s: float = 0.3  # s for the present client to answer when another one connects


@dataclass(kw_only=True)
class _Client:
    link: Link
    address: tuple[str, int]
    name: str


class LoopbackServer:
    """Server of one drone: `start`, `wait`, `close`. `start` binds the ports.

    Args:
        anafi: firmware of the drone or of its remote control.
        table: the known messages.
        options: addresses, ports and timeouts.
        media: content of the web interface.
    """

    def __init__(
        self,
        anafi: Anafi | RemoteControl,
        table: MessageTable,
        options: ServerOptions | None = None,
        *,
        media: MediaStore | None = None,
    ) -> None:
        self._anafi = anafi
        self._media = MediaStore() if media is None else media
        self._table = table
        self._options = options or ServerOptions()
        self.ports = self._options.ports  # the bound ports after `start`
        self._client: _Client | None = None
        self._udp: asyncio.DatagramTransport | None = None
        self._listeners: list[Listener] = []
        self._timer: asyncio.TimerHandle | None = None
        self._admission = asyncio.Lock()
        self._received = asyncio.Event()
        self._broken = asyncio.Event()
        self._failure: DroneError | None = None

    @property
    def client(self) -> str | None:
        """The name of the connected client; None without one."""
        return None if self._client is None else self._client.name

    async def start(self) -> None:
        """Bind all ports.

        Raises:
            PortTakenError: a port is taken, or may not be used.
        """
        wanted = self._options.ports
        try:
            control = await self._listen(wanted.control, "control", self._serve_control)
            discovery = await self._listen(wanted.discovery, "discovery", self._serve_discovery)
            http = await self._listen(wanted.http, "http", partial(serve_web, self._media))
            if isinstance(self._anafi, RemoteControl) and wanted.http:
                await self._listen(
                    wanted.http + _DRONE_BEHIND, "http", partial(serve_web, self._media)
                )
            self._discovery = discovery
            commands = await self._listen_udp(wanted.commands)
        except InputError:
            await self.close()
            raise
        self.ports = Ports(
            discovery=discovery.port,
            control=control.port,
            commands=commands,
            http=http.port,
            rtsp=wanted.rtsp,
        )
        self._schedule()

    async def wait(self) -> None:
        """Serve until the simulation fails.

        Raises:
            DroneError: the simulation failed.
        """
        await self._broken.wait()
        if self._failure is not None:
            raise self._failure

    async def close(self) -> None:
        """Disconnect and free the ports; safe to call twice."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._drop_client("the server stops")
        for listener in self._listeners:
            await listener.close()
        self._listeners.clear()
        if self._udp is not None:
            self._udp.close()
            self._udp = None

    # --- sockets ----------------------------------------------------------------------------------

    async def _listen(self, port: int, what: str, service: Service) -> Listener:
        listener = Listener(service)
        await listener.open(self._options.address, port, what)
        self._listeners.append(listener)
        return listener

    async def _listen_udp(self, port: int) -> int:
        loop = asyncio.get_running_loop()
        try:
            self._udp, _ = await loop.create_datagram_endpoint(
                lambda: _Datagrams(self._datagram), local_addr=(self._options.address, port)
            )
        except OSError as error:
            raise port_error(error, self._options.address, port, "command") from error
        return int(self._udp.get_extra_info("sockname")[1])

    # --- admission --------------------------------------------------------------------------------

    async def _serve_discovery(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        writer.write(announcement(self._options.identity, self.ports.control))
        await writer.drain()
        while await reader.read(MAX_REQUEST_BYTES):
            pass  # clients send nothing here; only the connection counts
        # A client has left. If it is the one that flies, it does not answer the probe.
        async with self._admission:
            await self._probe()

    async def _serve_control(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        request = await read_request(reader)
        host = str(writer.get_extra_info("peername")[0])
        async with self._admission:
            await self._probe()
            if self._client is not None:
                _LOG.warning("%s is refused: %s flies", host, self._client.name)
                writer.write(refused())
            else:
                self._admit(host, request)
                writer.write(accepted(self.ports.commands))
            await writer.drain()

    async def _probe(self) -> None:
        """Drop the client unless it answers a ping in time."""
        if self._client is None:
            return
        self._received.clear()
        self._client.link.ping(self._now())
        try:
            async with asyncio.timeout(self._options.probe_s):
                await self._received.wait()
        except TimeoutError:
            self._drop_client("it is gone")

    def _admit(self, host: str, request: ConnectionRequest) -> None:
        address = (host, request.events_port)
        udp = self._udp
        if udp is None:
            return

        def transmit(datagram: bytes) -> None:
            udp.sendto(datagram, address)

        link = Link(transmit, self._now(), timing=self._options.timing)
        name = f"{request.controller or 'a client'} at {host}:{request.events_port}"
        self._client = _Client(link=link, address=address, name=name)
        # A client that loses its discovery connection concludes that the drone is gone.
        self._discovery.keep_newest(host)
        _LOG.info("connected: %s", name)

        def send(message: MessageType, payload: bytes) -> None:
            link.send(payload, self._now(), acked=message.buffer is not Buffer.NOACK)

        self._anafi.connected(send)

    def _drop_client(self, why: str) -> None:
        if self._client is not None:
            _LOG.info("disconnected: %s (%s)", self._client.name, why)
            self._client = None
            if self._failure is None:
                self._anafi.disconnected()

    # --- traffic ----------------------------------------------------------------------------------

    def _datagram(self, data: bytes, address: tuple[Any, ...]) -> None:
        client = self._client
        if client is None or address[0] != client.address[0]:
            return
        before = client.link.received_s
        commands = client.link.receive(data, self._now())
        if client.link.received_s > before:
            self._received.set()
        for payload in commands:
            try:
                self._anafi.handle(decode(payload, self._table))
            except (WireError, DroneError) as error:
                _LOG.debug("ignored: %s", error)

    def _schedule(self) -> None:
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(self._options.update_s, self._update)

    def _update(self) -> None:
        try:
            self._anafi.update()
        except DroneError as error:
            self._failure = error
            self._broken.set()
            return
        client, now_s = self._client, self._now()
        if client is not None:
            client.link.poll(now_s)
            if client.link.dead(now_s):
                self._drop_client("it fell silent")
        self._schedule()

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, receive: Callable[[bytes, tuple[Any, ...]], None]) -> None:
        self._receive = receive

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        """Forward the datagram."""
        self._receive(data, addr)

    def error_received(self, exc: Exception) -> None:
        """Log an undelivered datagram; only the timeout of the link ends it."""
        _LOG.debug("a datagram did not arrive: %s", exc)
