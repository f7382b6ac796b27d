"""Network server of a loopback ANAFI: discovery, command link, web server and video."""

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
    ANAFI,
    SKYCONTROLLER,
    Ports,
    Request,
    announcement,
    answer,
    port_error,
    read_request,
)
from sim_bridge.loopback.link import Link
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.video import VideoServer
from sim_bridge.loopback.web import MAX_HEAD_BYTES, serve_web

_LOG = logging.getLogger(__name__)

# A remote control has the web server of its drone at this distance above the drone's port: Parrot's
# libarsdk connects to 180 in place of 80.
_DRONE_BEHIND: Final = 100
_UPDATE_S: Final = 0.02  # time between two updates of the firmware, s
_PROBE_S: Final = 0.3  # time for the present client to answer when another one connects, s

Service = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
Address = tuple[str, int]


@dataclass(kw_only=True)
class _Client:
    link: Link
    address: Address  # the only socket whose commands are executed
    name: str


class LoopbackServer(asyncio.DatagramProtocol):
    """Serves one client of a drone or of its remote control: `start`, `wait`, `close`."""

    def __init__(
        self,
        firmware: Anafi | RemoteControl,
        media: MediaStore,
        video: VideoServer | None = None,
        *,
        address: str,
        ports: Ports,
    ) -> None:
        self._firmware = firmware
        self._media = media
        self._video = video
        self._address = address
        self.ports = ports  # the bound ports after `start`
        self._client: _Client | None = None
        self._heard = asyncio.Event()  # set by each datagram of the client
        self._admission = asyncio.Lock()
        self._udp: asyncio.DatagramTransport | None = None
        self._servers: list[asyncio.Server] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._updates: asyncio.Task[None] | None = None
        self._fault: Exception | None = None  # of a command; ends the updates

    async def start(self) -> None:
        """Bind all ports; PortTakenError if one cannot be used, and then `close` is needed."""
        wanted, web = self.ports, partial(serve_web, self._media)
        control = await self._listen(wanted.control, "control", self._serve_control)
        discovery = await self._listen(wanted.discovery, "discovery", self._serve_discovery)
        http = await self._listen(wanted.http, "http", web)
        if isinstance(self._firmware, RemoteControl) and wanted.http:
            await self._listen(wanted.http + _DRONE_BEHIND, "http", web)
        rtsp = wanted.rtsp
        if self._video is not None:
            await self._video.open(self._address)
            rtsp = await self._listen(rtsp, "video", self._video.serve)
        loop = asyncio.get_running_loop()
        try:
            self._udp, _ = await loop.create_datagram_endpoint(
                lambda: self, local_addr=(self._address, wanted.commands)
            )
        except OSError as error:
            raise port_error(error, self._address, wanted.commands, "command") from error
        commands = self._udp.get_extra_info("sockname")[1]
        self.ports = replace(
            wanted, discovery=discovery, control=control, commands=commands, http=http, rtsp=rtsp
        )
        self._updates = asyncio.create_task(self._update())
        self._tasks.add(self._updates)

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
        tasks = tuple(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if self._video is not None:
            await self._video.close()

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

    async def _serve_discovery(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        identity = SKYCONTROLLER if isinstance(self._firmware, RemoteControl) else ANAFI
        writer.write(announcement(identity, self.ports.control))
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
                writer.write(answer(self.ports.commands))
            else:
                _LOG.warning("%s is refused: %s flies", host, self._client.name)
                writer.write(answer(None))
            await writer.drain()

    async def _probe(self) -> None:
        """Drop the client unless it answers a ping in time."""
        if self._client is not None:
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

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        """Execute the commands of a datagram of the client."""
        client = self._client
        failed = self._updates is None or self._updates.done()
        if failed or client is None or addr[:2] != client.address:
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
