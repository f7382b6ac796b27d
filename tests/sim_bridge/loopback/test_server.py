"""The loopback ANAFI over real sockets."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from random import Random
from typing import Any

import pytest

from sim_bridge.loopback.codec import encode
from sim_bridge.loopback.drone import DroneSetup, LoopbackDrone
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.handshake import Ports, PortTakenError
from sim_bridge.loopback.link import FrameType, WireFrame, pack
from sim_bridge.loopback.server import LoopbackServer
from sim_bridge.loopback.world import WorldState
from tests.sim_bridge.loopback.loopback_client import PATIENCE_S, Client
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.errors import DroneError
from uav_bt.types import FlyingState

FREE = Ports(discovery=0, control=0, commands=0, http=0, rtsp=0)
FLYING = "ardrone3.PilotingState.FlyingStateChanged"
TAKE_OFF = WireFrame(
    type=FrameType.DATA_WITH_ACK,
    buffer=11,
    sequence=900,
    payload=pack([encode("ardrone3.Piloting.TakeOff", {})]),
).to_bytes()


@asynccontextmanager
async def serving(ports: Ports = FREE, **options: Any) -> AsyncIterator[LoopbackServer]:
    """Serve a drone whose time passes ten times faster than real time."""
    bench = Bench()
    update = bench.anafi.update

    def advance() -> None:
        for _ in range(10):
            bench.clock.advance(0.02)
            bench.world.catch_up()
            update()

    bench.anafi.update = advance  # type: ignore[method-assign]
    server = LoopbackServer(bench.anafi, bench.media, ports=ports, **options)
    try:
        await server.start()
        yield server
    finally:
        await server.close()
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
            await client.send("ardrone3.Piloting.Landing")
            await client.wait(FLYING, state="landed")
            client.close()

    asyncio.run(run())


def test_clients_come_and_go_one_at_a_time() -> None:
    async def run() -> None:
        async with serving() as server:
            (await connected(server)).close()
            dies = await connected(server)
            dies._udp.close()  # killed, but its discovery connection stays open
            first = await connected(server)
            second = Client(server.ports, name="second")
            assert not await second.connect()
            assert second.answer["status"] == -1
            second.close()
            await first.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
            await first.wait("ardrone3.PilotingSettingsState.MaxTiltChanged", current=12.0)
            first.close()
            dies._keep.close()

    asyncio.run(run())


@pytest.mark.parametrize("flies", [True, False])
def test_commands_of_another_socket_are_ignored(*, flies: bool) -> None:
    async def run() -> None:
        async with serving() as server:
            client = await connected(server)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
                other.sendto(TAKE_OFF, ("127.0.0.1", server.ports.commands))
            if flies:
                client.put(TAKE_OFF)
            await client.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
            await client.wait("ardrone3.PilotingSettingsState.MaxTiltChanged", current=12.0)
            await asyncio.sleep(0.3)
            states = {one.values["state"] for one in client.events if one.name == FLYING}
            assert bool(states) is flies
            client.close()

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
            await client.send("ardrone3.Piloting.TakeOff")
            await client.wait(FLYING, state="hovering")
            client.close()

    asyncio.run(run())


REQUEST = {"controller_name": "olympe", "d2c_port": 9988, "proto_v_min": 1, "proto_v_max": 3}


@pytest.mark.parametrize(
    ("request_", "answers"),
    [
        (json.dumps(REQUEST).encode(), True),
        (json.dumps(REQUEST).encode() + b"\0", True),
        *[
            (json.dumps(REQUEST | change).encode(), False)
            for change in (
                {"d2c_port": 0},
                {"d2c_port": True},
                {"d2c_port": "9988"},
                {"proto_v_max": 1},
            )
        ],
        *[(data, False) for data in (b"{}", b"[1]\0", b"\xff\0", b"[" * 5000 + b"}")],
    ],
)
def test_only_a_request_for_a_link_is_answered(request_: bytes, *, answers: bool) -> None:
    async def run() -> None:
        async with serving() as server:
            reader, writer = await asyncio.open_connection("127.0.0.1", server.ports.control)
            writer.write(request_)
            async with asyncio.timeout(PATIENCE_S):
                answer = await reader.read()
            writer.close()
            assert bool(answer) is answers
            if answers:
                assert json.loads(answer[:-1])["c2d_port"] == server.ports.commands

    asyncio.run(run())


@pytest.mark.parametrize("what", ["http", "address"])
def test_a_port_that_cannot_be_bound_is_one_clear_error(what: str) -> None:
    async def run() -> None:
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            ports, options = FREE, {"address": "203.0.113.1"}
            message = r"has no address 203\.0\.113\.1"
            if what == "http":
                ports, options = Ports(discovery=0, control=0, commands=0, http=port), {}
                message = f"http port {port} of 127.0.0.1 is taken"
            with pytest.raises(PortTakenError, match=message):
                async with serving(ports, **options):
                    pass

    asyncio.run(run())


@pytest.mark.parametrize(
    ("error", "message", "lands"),
    [
        (DroneError("the wings fell off"), "the wings fell off", False),
        (ValueError("not finite"), r"firmware failed \(ValueError: not finite\).*has landed", True),
    ],
)
@pytest.mark.parametrize("of", ["handle", "update"])
def test_a_failure_ends_the_service_with_a_message(
    monkeypatch: pytest.MonkeyPatch, of: str, error: Exception, message: str, *, lands: bool
) -> None:
    def fail(*_: object) -> None:
        raise error

    async def run() -> WorldState:
        drone = LoopbackDrone(DroneSetup(ports=FREE, video=False))
        await drone.start()
        try:
            client = Client(drone.ports)
            assert await client.connect()
            await client.send("ardrone3.Piloting.TakeOff")
            await client.wait(FLYING, state="hovering")
            monkeypatch.setattr(Anafi, of, fail)
            client.put(
                WireFrame.to_bytes(
                    WireFrame(
                        type=FrameType.DATA,
                        buffer=10,
                        sequence=5,
                        payload=pack([encode("ardrone3.Piloting.TakeOff", {})]),
                    )
                )
            )
            async with asyncio.timeout(PATIENCE_S):
                with pytest.raises(DroneError, match=message):
                    await drone.wait()
            client.close()
            return drone.world.state()
        finally:
            await drone.close()

    assert (asyncio.run(run()).flying is FlyingState.LANDED) is lands
