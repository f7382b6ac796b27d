"""Test client and server of the loopback ANAFI: asyncio and the project's link, without the SDK."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

from sim_bridge.loopback.codec import Message, decode, encode, message_types
from sim_bridge.loopback.handshake import Ports
from sim_bridge.loopback.link import Link
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.server import LoopbackServer
from sim_bridge.loopback.video import VideoServer
from tests.sim_bridge.loopback.loopback_world import full_name

HOST = "127.0.0.1"
PATIENCE_S = 60.0  # timeout of a test, also on a busy machine, s
FREE = Ports(discovery=0, control=0, commands=0, http=0, rtsp=0)
POLL_S = 0.1


@asynccontextmanager
async def serving(
    firmware: Any = None,
    media: MediaStore | None = None,
    video: VideoServer | None = None,
    *,
    ports: Ports = FREE,
    address: str = HOST,
) -> AsyncIterator[LoopbackServer]:
    """Serve a drone; without a firmware it only has media and video."""
    firmware = firmware or SimpleNamespace(update=lambda: None)
    media = MediaStore() if media is None else media
    server = LoopbackServer(firmware, media, video, ports=ports, address=address)
    try:
        await server.start()
        yield server
    finally:
        await server.close()
        await server.close()


class Client(asyncio.DatagramProtocol):
    """Discovers the drone, opens a link, sends commands and waits for events."""

    def __init__(self, ports: Ports) -> None:
        self._ports = ports
        self._news = asyncio.Event()
        self.events: list[Message] = []
        self._seen = 0  # number of events that `wait` has passed
        self.answer: dict[str, Any] = {}

    async def connect(self) -> bool:
        loop = asyncio.get_running_loop()
        found, self.discovery = await asyncio.open_connection(HOST, self._ports.discovery)
        self.card = json.loads((await found.readuntil(b"\0"))[:-1])
        self.udp, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=(HOST, 0))
        self._link = Link(self.put, loop.time())
        port = self.udp.get_extra_info("sockname")[1]
        reader, writer = await asyncio.open_connection(HOST, self.card["port"])
        writer.write(json.dumps({"d2c_port": port, "proto_v_max": 2}).encode() + b"\0")
        self.answer = json.loads((await reader.readuntil(b"\0"))[:-1])
        writer.close()
        return bool(self.answer["status"] == 0)

    def close(self) -> None:
        self.discovery.close()
        self.udp.close()

    def put(self, data: bytes) -> None:
        """Send a datagram unchanged."""
        self.udp.sendto(data, (HOST, self.answer["c2d_port"]))

    async def ask(self, command: str, event: str, /, **values: Any) -> Message:
        """Send a command, and return the next event with this name."""
        name, now_s = full_name(command), asyncio.get_running_loop().time()
        self._link.send(encode(name, values), now_s, acked=message_types()[name].buffer != "noack")
        return await self.wait(event)

    async def wait(self, name: str, /, **values: Any) -> Message:
        """Return the next event with this name and these values; earlier events are skipped."""
        while True:
            for event in self.events[self._seen :]:
                self._seen += 1
                if event.name == full_name(name) and values.items() <= event.values.items():
                    return event
            self._link.poll(asyncio.get_running_loop().time())
            self._news.clear()
            await asyncio.wait([asyncio.ensure_future(self._news.wait())], timeout=POLL_S)

    def datagram_received(self, data: bytes, _addr: Any) -> None:
        for payload in self._link.receive(data, asyncio.get_running_loop().time()):
            self.events.append(decode(payload))
            self._news.set()
