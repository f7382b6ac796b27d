"""A proxy before a loopback ANAFI that drops, doubles and reorders datagrams.

A client connects to the proxy's address as if the drone were there. The TCP connections pass as
they are, but for the two ports of the command link, which become the proxy's own.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass

DISCOVERY, CONTROL, HTTP = 44445, 44444, 80
LATE_S = 0.03  # for a datagram that is overtaken: some later ones pass meanwhile
LOOPBACK = "127.0.0.1"  # where connections to loopback addresses come from

Address = tuple[str, int]
Service = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@dataclass(frozen=True, kw_only=True)
class Loss:
    """Shares of the datagrams, each way."""

    dropped: float = 0.05
    doubled: float = 0.05
    late: float = 0.05


@dataclass(kw_only=True)
class Tally:
    """What happened to the datagrams."""

    passed: int = 0
    dropped: int = 0
    doubled: int = 0
    late: int = 0


class _Relay(asyncio.DatagramProtocol):
    """Hands what comes to `forward`."""

    def __init__(self, forward: Callable[[bytes], None]) -> None:
        self._forward = forward

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """Pass it on."""
        del addr
        self._forward(data)


class LossyProxy:
    """Listens at one address in place of a drone at another."""

    def __init__(self, address: str, drone: str, *, loss: Loss, seed: int) -> None:
        self.tally = Tally()
        self._address, self._drone, self._loss = address, drone, loss
        self._random = random.Random(seed)  # noqa: S311 - a fault, not a secret
        self._sockets: list[asyncio.DatagramTransport] = []

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Listen while this lasts."""
        async with contextlib.AsyncExitStack() as stack:
            for port, serve in (
                (CONTROL, self._serve_control),
                (DISCOVERY, self._plain(DISCOVERY)),
                (HTTP, self._plain(HTTP)),
            ):
                server = await asyncio.start_server(serve, self._address, port)
                stack.callback(server.close)
            stack.callback(self._close_sockets)
            yield

    def _close_sockets(self) -> None:
        for transport in self._sockets:
            transport.close()

    def _pass_on(self, send: Callable[[], None]) -> None:
        loop, tally, luck = asyncio.get_running_loop(), self.tally, self._random.random()
        if luck < self._loss.dropped:
            tally.dropped += 1
            return
        luck -= self._loss.dropped
        tally.passed += 1
        if luck < self._loss.doubled:
            tally.doubled += 1
            send()
        elif luck < self._loss.doubled + self._loss.late:
            tally.late += 1
            loop.call_later(LATE_S, send)
            return
        send()

    def _plain(self, port: int) -> Service:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            far_reader, far_writer = await asyncio.open_connection(self._drone, port)
            await asyncio.gather(_pump(reader, far_writer), _pump(far_reader, writer))

        return serve

    async def _serve_control(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Pass the two JSON lines on, with the proxy's own ports in them."""
        loop = asyncio.get_running_loop()
        far_reader, far_writer = await asyncio.open_connection(self._drone, CONTROL)
        request = json.loads((await reader.read(8192)).rstrip(b"\0"))
        events_to: Address = (writer.get_extra_info("peername")[0], request["d2c_port"])
        commands_to: list[Address] = []

        near, _ = await loop.create_datagram_endpoint(
            lambda: _Relay(lambda data: self._pass_on(lambda: far.sendto(data, commands_to[0]))),
            local_addr=(self._address, 0),
        )
        far, _ = await loop.create_datagram_endpoint(
            lambda: _Relay(lambda data: self._pass_on(lambda: near.sendto(data, events_to))),
            local_addr=(LOOPBACK, 0),
        )
        self._sockets += [near, far]
        request["d2c_port"] = far.get_extra_info("sockname")[1]
        far_writer.write(json.dumps(request).encode() + b"\0")
        answer = json.loads((await far_reader.read(8192)).rstrip(b"\0"))
        if answer["status"] == 0:
            commands_to.append((self._drone, answer["c2d_port"]))
            answer["c2d_port"] = near.get_extra_info("sockname")[1]
        writer.write(json.dumps(answer).encode() + b"\0")
        await asyncio.gather(_pump(reader, far_writer), _pump(far_reader, writer))


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    with contextlib.suppress(OSError):
        writer.close()
