"""Test client of the loopback ANAFI: asyncio and the project's codec, without the SDK."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any

from sim_bridge.loopback.codec import Message, decode, encode, message_types
from sim_bridge.loopback.handshake import Ports
from sim_bridge.loopback.link import SEQUENCES, FrameType, WireFrame, pack, parse, unpack

PATIENCE_S = 60.0  # timeout of a wait, also on a busy machine, s
REPEAT_S = 0.1


class Client(asyncio.DatagramProtocol):
    """Discovers the drone, opens a link, sends commands and waits for events."""

    def __init__(self, ports: Ports, *, name: str = "test") -> None:
        self._ports = ports
        self._name = name
        self._sequences: dict[int, int] = {}
        self._last: dict[int, int] = {}
        self._acked: asyncio.Queue[int] = asyncio.Queue()
        self._news = asyncio.Event()
        self.events: deque[Message] = deque()
        self.answer: dict[str, Any] = {}

    async def connect(self) -> bool:
        loop = asyncio.get_running_loop()
        host = "127.0.0.1"
        self._found, self._keep = await asyncio.open_connection(host, self._ports.discovery)
        self.card = json.loads((await self._found.readuntil(b"\0"))[:-1])
        self._udp, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=(host, 0))
        request = {
            "controller_name": self._name,
            "controller_type": "test",
            "d2c_port": self._udp.get_extra_info("sockname")[1],
            "device_id": self.card["serial"],
            "proto_v_min": 1,
            "proto_v_max": 2,
        }
        reader, writer = await asyncio.open_connection(host, self.card["port"])
        writer.write(json.dumps(request).encode() + b"\0")
        self.answer = json.loads((await reader.readuntil(b"\0"))[:-1])
        writer.close()
        return bool(self.answer["status"] == 0)

    def close(self) -> None:
        self._keep.close()
        self._udp.close()

    async def send(self, name: str, /, **values: Any) -> None:
        """Send a command; wait for its acknowledgement if it needs one."""
        acked = message_types()[name].buffer != "noack"
        payload = pack([encode(name, values)])
        kind = FrameType.DATA_WITH_ACK if acked else FrameType.DATA
        frame = self._frame(kind, 11 if acked else 10, payload)
        async with asyncio.timeout(PATIENCE_S):
            while True:
                self.put(frame.to_bytes())
                if not acked:
                    return
                try:
                    async with asyncio.timeout(REPEAT_S):
                        while await self._acked.get() != frame.sequence:
                            pass
                        return
                except TimeoutError:
                    continue

    def put(self, data: bytes) -> None:
        """Send a datagram unchanged."""
        self._udp.sendto(data, ("127.0.0.1", self.answer["c2d_port"]))

    async def wait(self, name: str, /, **values: Any) -> Message:
        """Return the next event with this name and these values; earlier events are skipped."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                while self.events:
                    event = self.events.popleft()
                    if event.name == name and values.items() <= dict(event.values).items():
                        return event
                self._news.clear()
                await self._news.wait()

    def datagram_received(self, data: bytes, addr: Any) -> None:
        del addr
        for frame in parse(data):
            if frame.type is FrameType.ACK:
                self._acked.put_nowait(int.from_bytes(frame.payload, "little"))
            elif frame.buffer == 0:
                self.put(self._frame(FrameType.DATA, 1, frame.payload).to_bytes())
            elif frame.buffer in (126, 127):
                self._take(frame)

    def _take(self, frame: WireFrame) -> None:
        if frame.type is FrameType.DATA_WITH_ACK:
            ack = self._frame(FrameType.ACK, frame.buffer + 128, frame.acknowledgement)
            self.put(ack.to_bytes())
            if self._last.get(frame.buffer) == frame.sequence:
                return
            self._last[frame.buffer] = frame.sequence
        self.events += [decode(one) for one in unpack(frame.payload)]
        self._news.set()

    def _frame(self, kind: FrameType, buffer: int, payload: bytes) -> WireFrame:
        sequence = (self._sequences.get(buffer, -1) + 1) % SEQUENCES
        self._sequences[buffer] = sequence
        return WireFrame(type=kind, buffer=buffer, sequence=sequence, payload=payload)
