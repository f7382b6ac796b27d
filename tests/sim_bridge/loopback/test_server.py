"""The loopback ANAFI over real sockets, with a fake body."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random

import pytest

from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.handshake import Ports, PortTakenError
from sim_bridge.loopback.link import LinkTiming
from sim_bridge.loopback.messages import message_table
from sim_bridge.loopback.server import LoopbackServer, ServerOptions
from sim_bridge.loopback.world import WorldState
from tests.sim_bridge.loopback.loopback_client import PATIENCE_S, Client
from tests.sim_bridge.loopback.loopback_world import FakeWorld
from uav_bt.errors import DroneError

FREE = Ports(discovery=0, control=0, commands=0, http=0, rtsp=0)
FLYING = "ardrone3.PilotingState.FlyingStateChanged"


class LiveWorld(FakeWorld):
    """A world whose time passes at each call of `state`, ten times faster than real time."""

    broken = False

    def state(self) -> WorldState:
        if self.broken:
            raise DroneError("the wings fell off")
        self.advance()
        return super().state()


@asynccontextmanager
async def serving(world: FakeWorld | None = None) -> AsyncIterator[LoopbackServer]:
    # Long timeouts, because the machine may be busy.
    timing = LinkTiming(silence_s=PATIENCE_S)
    options = ServerOptions(ports=FREE, timing=timing, update_s=0.002, probe_s=0.5)
    server = LoopbackServer(Anafi(world or LiveWorld(), message_table()), message_table(), options)
    await server.start()
    try:
        yield server
    finally:
        await server.close()


async def connected(server: LoopbackServer) -> Client:
    client = Client(server.ports)
    assert await client.connect()
    await client.send("common.Common.AllStates")
    await client.wait("common.CommonState.AllStatesChanged")
    await client.send("common.Settings.AllSettings")
    await client.wait("common.SettingsState.AllSettingsChanged")
    return client


def test_a_client_connects_flies_and_lands() -> None:
    async def run() -> None:
        async with serving() as server:
            client = await connected(server)
            assert client.card["model.id"] == "0x0914"
            assert client.answer["proto_v"] == 2
            await client.send("ardrone3.Piloting.TakeOff")
            await client.wait(FLYING, state="hovering")
            await client.send("ardrone3.Piloting.moveBy", dX=1.0, dY=0.0, dZ=0.0, dPsi=0.0)
            end = await client.wait("ardrone3.PilotingEvent.moveByEnd", error="ok")
            assert end.values["dX"] == pytest.approx(1.0, abs=0.05)
            await client.wait(FLYING, state="hovering")
            await client.send("ardrone3.Piloting.Landing")
            await client.wait(FLYING, state="landed")
            client.close()

    asyncio.run(run())


def test_many_clients_come_and_go() -> None:
    async def run() -> None:
        async with serving() as server:
            for _ in range(5):
                client = await connected(server)
                client.close()

    asyncio.run(run())


def test_a_second_client_is_refused_while_the_first_one_lives() -> None:
    async def run() -> None:
        async with serving() as server:
            first = await connected(server)
            second = Client(server.ports, name="second")
            assert not await second.connect()
            assert second.answer["status"] != 0
            second.close()
            await first.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
            await first.wait("ardrone3.PilotingSettingsState.MaxTiltChanged", current=12.0)
            first.close()

    asyncio.run(run())


def test_a_client_that_dies_silently_makes_room_for_another() -> None:
    async def run() -> None:
        async with serving() as server:
            first = await connected(server)
            first._udp.close()  # killed, but its discovery connection stays open
            second = await connected(server)
            second.close()
            first._keep.close()

    asyncio.run(run())


@pytest.mark.parametrize("port", ["discovery", "control", "http"])
def test_idle_connections_make_room(port: str) -> None:
    """With more connections than the limit, that of the flying client stays open."""

    async def run() -> None:
        async with serving() as server:
            flies = await connected(server)
            where = ("127.0.0.1", getattr(server.ports, port))
            idle = [await asyncio.open_connection(*where) for _ in range(100)]
            other = Client(server.ports, name="other")
            assert not await other.connect()
            assert other.answer["status"] != 0  # an answer, although a refusal
            assert not flies._found.at_eof()
            await flies.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
            await flies.wait("ardrone3.PilotingSettingsState.MaxTiltChanged", current=12.0)
            for _, writer in idle:
                writer.close()
            flies.close()
            other.close()

    asyncio.run(run())


def test_garbage_on_every_port_is_survived() -> None:
    async def run() -> None:
        random = Random(7)  # noqa: S311 - not for secrets
        async with serving() as server:
            client = await connected(server)
            ports = server.ports
            for _ in range(300):
                client.put(random.randbytes(random.randrange(60)))
            for port in (ports.discovery, ports.control, ports.http):
                for size in (0, 1, 100, 20_000):
                    _, writer = await asyncio.open_connection("127.0.0.1", port)
                    writer.write(random.randbytes(size))
                    writer.close()
            for request in (b"{}", b"[1]\0", b'{"d2c_port": 0}', b'{"d2c_port": "x"}', b"\xff\0"):
                reader, writer = await asyncio.open_connection("127.0.0.1", ports.control)
                writer.write(request)
                async with asyncio.timeout(PATIENCE_S):
                    assert await reader.read() == b""
                writer.close()
            await client.send("ardrone3.Piloting.TakeOff")
            await client.wait(FLYING, state="hovering")
            client.close()

    asyncio.run(run())


def test_a_taken_port_is_one_clear_error() -> None:
    async def run() -> None:
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            ports = Ports(discovery=0, control=0, commands=0, http=port)
            anafi = Anafi(FakeWorld(), message_table())
            server = LoopbackServer(anafi, message_table(), ServerOptions(ports=ports))
            with pytest.raises(PortTakenError, match=f"http port {port} of 127.0.0.1 is taken"):
                await server.start()

    asyncio.run(run())


def test_an_address_of_another_machine_is_one_clear_error() -> None:
    async def run() -> None:
        anafi = Anafi(FakeWorld(), message_table())
        options = ServerOptions(address="203.0.113.1", ports=FREE)
        server = LoopbackServer(anafi, message_table(), options)
        with pytest.raises(PortTakenError, match=r"has no address 203\.0\.113\.1"):
            await server.start()

    asyncio.run(run())


def test_a_body_that_fails_ends_the_service() -> None:
    async def run() -> None:
        world = LiveWorld()
        async with serving(world) as server:
            client = await connected(server)
            world.broken = True
            async with asyncio.timeout(PATIENCE_S):
                with pytest.raises(DroneError, match="wings fell off"):
                    await server.wait()
            client.close()

    asyncio.run(run())


def test_the_web_server_has_an_empty_media_list_and_notifies_of_nothing() -> None:
    async def run() -> None:
        async with serving() as server:
            reader, writer = await asyncio.open_connection("127.0.0.1", server.ports.http)
            writer.write(b"GET /api/v1/media/medias?x=1 HTTP/1.1\r\nHost: a\r\n\r\n")
            head = await reader.readuntil(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 200 OK")
            assert json.loads(await reader.readexactly(2)) == []
            writer.write(b"GET /api/v1/elsewhere HTTP/1.1\r\nConnection: close\r\n\r\n")
            assert (await reader.read()).startswith(b"HTTP/1.1 404 Not Found")
            writer.close()

    asyncio.run(run())


def test_a_websocket_is_kept_and_its_pings_are_answered() -> None:
    async def run() -> None:
        async with serving() as server:
            reader, writer = await asyncio.open_connection("127.0.0.1", server.ports.http)
            writer.write(
                b"GET /api/v1/media/notifications HTTP/1.1\r\nUpgrade: websocket\r\n"
                b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            )
            head = await reader.readuntil(b"\r\n\r\n")
            # The key and its answer are the example of RFC 6455.
            assert b"Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in head
            writer.write(bytes.fromhex("89 82 01020304 6060"))
            assert await reader.readexactly(4) == bytes.fromhex("8a 02 6162")
            writer.write(bytes.fromhex("88 80 00000000"))
            assert await reader.read() == bytes.fromhex("88 00")
            writer.close()

    asyncio.run(run())
