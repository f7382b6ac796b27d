"""A proxy before a loopback ANAFI that drops, doubles and delays datagrams, 5 % each, both ways.

A client connects to the proxy's address as if the drone were there. The TCP connections pass as
they are, but for the two ports of the command link, which become the proxy's own.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

DISCOVERY, CONTROL, HTTP = 44445, 44444, 80
SHARE = 0.05
LATE_S = 0.03  # some later datagrams pass meanwhile

Reader, Writer = asyncio.StreamReader, asyncio.StreamWriter


class _Relay(asyncio.DatagramProtocol):
    """Hands each datagram, or not, or twice, to a function."""

    def __init__(self, forward: Callable[[bytes], None], luck: random.Random) -> None:
        self._forward = forward
        self._luck = luck

    def datagram_received(self, data: bytes, addr: object) -> None:
        del addr
        luck = self._luck.random()
        if luck < SHARE:
            return
        if luck < 2 * SHARE:
            self._forward(data)
        if luck < 3 * SHARE:
            asyncio.get_running_loop().call_later(LATE_S, self._forward, data)
        else:
            self._forward(data)


@asynccontextmanager
async def lossy(address: str, drone: str, *, seed: int) -> AsyncIterator[None]:
    """Listen at one address in place of a drone at another."""
    luck, loop = random.Random(seed), asyncio.get_running_loop()  # noqa: S311 - no secret
    sockets: list[asyncio.DatagramTransport] = []

    async def relay(
        local: str, forward: Callable[[bytes], None]
    ) -> tuple[asyncio.DatagramTransport, int]:
        transport, _ = await loop.create_datagram_endpoint(
            lambda: _Relay(forward, luck), local_addr=(local, 0)
        )
        sockets.append(transport)
        return transport, transport.get_extra_info("sockname")[1]

    async def control(reader: Reader, writer: Writer) -> None:
        """Pass the two JSON lines on, with the proxy's own ports in them."""
        far_reader, far_writer = await asyncio.open_connection(drone, CONTROL)
        request = json.loads((await reader.read(8192)).rstrip(b"\0"))
        events_to = writer.get_extra_info("peername")[0], request["d2c_port"]
        commands_to = drone, 0
        near, near_port = await relay(address, lambda data: far.sendto(data, commands_to))
        far, request["d2c_port"] = await relay(
            "127.0.0.1", lambda data: near.sendto(data, events_to)
        )
        far_writer.write(json.dumps(request).encode() + b"\0")
        answer = json.loads((await far_reader.read(8192)).rstrip(b"\0"))
        if answer["status"] == 0:
            commands_to = drone, answer["c2d_port"]
            answer["c2d_port"] = near_port
        writer.write(json.dumps(answer).encode() + b"\0")
        await asyncio.gather(_pump(reader, far_writer), _pump(far_reader, writer))

    async def plain(reader: Reader, writer: Writer) -> None:
        port = writer.get_extra_info("sockname")[1]
        far_reader, far_writer = await asyncio.open_connection(drone, port)
        await asyncio.gather(_pump(reader, far_writer), _pump(far_reader, writer))

    async with contextlib.AsyncExitStack() as stack:
        for port, serve in ((CONTROL, control), (DISCOVERY, plain), (HTTP, plain)):
            server = await asyncio.start_server(serve, address, port)
            stack.callback(server.close)
        yield
    for transport in sockets:
        transport.close()


async def _pump(reader: Reader, writer: Writer) -> None:
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(65536):
            writer.write(data)
            await writer.drain()
    with contextlib.suppress(OSError):
        writer.close()
