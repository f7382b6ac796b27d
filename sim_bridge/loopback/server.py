"""Network server of a loopback ANAFI: discovery, command link and web server."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from sim_bridge.loopback.codec import WireError, decode
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import (
    SKYCONTROLLER,
    Identity,
    Ports,
    Request,
    accepted,
    announcement,
    port_error,
    read_request,
    refused,
)
from sim_bridge.loopback.link import Link
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.web import MAX_HEAD_BYTES, serve_web

_LOG = logging.getLogger(__name__)

# A remote control has the web server of its drone at this distance above the drone's port: Parrot's
# libarsdk connects to 180 in place of 80.
_DRONE_BEHIND: Final = 100
_UPDATE_S: Final = 0.02  # time between two updates of the firmware, s
_PROBE_S: Final = 0.3  # time for the present client to answer when another one connects, s

Service = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@dataclass(kw_only=True)
class _Client:
    link: Link
    address: tuple[str, int]  # the only socket whose commands are executed
    name: str


class LoopbackServer:
    """Server of one drone: `start`, `wait`, `close`. `start` binds the ports.

    Args:
        firmware: of the drone or of its remote control.
        media: content of the web interface.
        address: numeric address to listen on.
        ports: the ports; 0 takes a free one.
    """

    def __init__(
        self,
        firmware: Anafi | RemoteControl,
        media: MediaStore,
        *,
        address: str = "127.0.0.1",
        ports: Ports,
    ) -> None:
        self._firmware = firmware
        self._media = media
        self._address = address
        self.ports = ports  # the bound ports after `start`
        self._client: _Client | None = None
        self._heard = asyncio.Event()  # set by each datagram of the client
        self._admission = asyncio.Lock()
        self._udp: asyncio.DatagramTransport | None = None
        self._servers: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[Any]] = set()
        self._updates: asyncio.Task[None] | None = None
        self._fault: Exception | None = None  # of a command; ends the updates

    async def start(self) -> None:
        """Bind all ports; `close` is needed even if this fails.

        Raises:
            PortTakenError: a port is taken, or may not be used.
        """
        wanted = self.ports
        web = partial(serve_web, self._media)
        control = await self._listen(wanted.control, "control", self._serve_control)
        discovery = await self._listen(wanted.discovery, "discovery", self._serve_discovery)
        http = await self._listen(wanted.http, "http", web)
        if isinstance(self._firmware, RemoteControl) and wanted.http:
            await self._listen(wanted.http + _DRONE_BEHIND, "http", web)
        commands = await self._listen_udp(wanted.commands)
        self.ports = replace(
            wanted, discovery=discovery, control=control, commands=commands, http=http
        )
        self._updates = asyncio.create_task(self._update())

    async def wait(self) -> None:
        """Serve until the firmware or the simulation fails, with its error."""
        if self._updates is not None:
            await asyncio.shield(self._updates)

    async def close(self) -> None:
        """End all connections and free the ports; safe to call twice."""
        for server in self._servers:
            server.close()
        if self._udp is not None:
            self._udp.close()
        tasks = [*self._tasks] if self._updates is None else [*self._tasks, self._updates]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    # --- ports ------------------------------------------------------------------------------------

    async def _listen(self, port: int, what: str, service: Service) -> int:
        """Serve the connections of a TCP port; return its number."""

        def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.create_task(_converse(service, reader, writer))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

        try:
            server = await asyncio.start_server(accept, self._address, port, limit=MAX_HEAD_BYTES)
        except OSError as error:
            raise port_error(error, self._address, port, what) from error
        self._servers.append(server)
        return int(server.sockets[0].getsockname()[1])

    async def _listen_udp(self, port: int) -> int:
        loop = asyncio.get_running_loop()
        try:
            self._udp, _ = await loop.create_datagram_endpoint(
                lambda: _Datagrams(self._datagram), local_addr=(self._address, port)
            )
        except OSError as error:
            raise port_error(error, self._address, port, "command") from error
        return int(self._udp.get_extra_info("sockname")[1])

    # --- admission --------------------------------------------------------------------------------

    async def _serve_discovery(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        identity = SKYCONTROLLER if isinstance(self._firmware, RemoteControl) else Identity()
        writer.write(announcement(identity, self.ports.control))
        await writer.drain()
        while await reader.read(MAX_HEAD_BYTES):
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
            if self._client is None:
                self._admit(host, request)
                writer.write(accepted(self.ports.commands))
            else:
                _LOG.warning("%s is refused: %s flies", host, self._client.name)
                writer.write(refused())
            await writer.drain()

    async def _probe(self) -> None:
        """Drop the client unless it answers a ping in time."""
        if self._client is None:
            return
        self._heard.clear()
        self._client.link.ping(_now())
        try:
            async with asyncio.timeout(_PROBE_S):
                await self._heard.wait()
        except TimeoutError:
            self._drop_client("it is gone")

    def _admit(self, host: str, request: Request) -> None:
        address = (host, request.d2c_port)

        def transmit(datagram: bytes) -> None:
            if self._udp is not None:
                self._udp.sendto(datagram, address)

        link = Link(transmit, _now())
        name = f"{request.controller_name} at {host}:{request.d2c_port}"
        self._client = _Client(link=link, address=address, name=name)
        _LOG.info("connected: %s", name)
        self._firmware.connected(lambda event, acked: link.send(event, _now(), acked=acked))

    def _drop_client(self, why: str) -> None:
        if self._client is not None:
            _LOG.info("disconnected: %s (%s)", self._client.name, why)
            self._client = None
            self._firmware.disconnected()

    # --- traffic ----------------------------------------------------------------------------------

    def _datagram(self, data: bytes, address: tuple[Any, ...]) -> None:
        client = self._client
        failed = self._updates is None or self._updates.done()
        if failed or client is None or address[:2] != client.address:
            return
        self._heard.set()
        try:
            for payload in client.link.receive(data, _now()):
                with contextlib.suppress(WireError):
                    self._firmware.handle(decode(payload))
        except Exception as error:  # noqa: BLE001 - `wait` raises it
            self._fault = error

    async def _update(self) -> None:
        """Update firmware and link until one of them fails."""
        while self._fault is None:
            await asyncio.sleep(_UPDATE_S)
            self._firmware.update()
            if self._client is not None:
                self._client.link.poll(_now())
                if self._client.link.dead(_now()):
                    self._drop_client("it fell silent")
        raise self._fault


async def _converse(
    service: Service, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """Serve one connection; its errors do not end the server."""
    try:
        await service(reader, writer)
    except (OSError, WireError) as error:
        _LOG.info("a connection ended: %s", error)
    finally:
        writer.close()


def _now() -> float:
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
