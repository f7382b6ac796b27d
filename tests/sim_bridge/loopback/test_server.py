"""The loopback ANAFI over real sockets."""

from __future__ import annotations

import asyncio
import json
import socket
from random import Random
from typing import Any

import pytest

from sim_bridge.loopback.codec import encode
from sim_bridge.loopback.drone import DroneSetup, LoopbackDrone
from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.handshake import Ports, PortTakenError
from sim_bridge.loopback.link import FrameType, WireFrame, pack
from sim_bridge.loopback.server import LoopbackServer
from tests.sim_bridge.loopback.loopback_client import FREE, HOST, Client, serving
from tests.sim_bridge.loopback.loopback_world import Bench, full_name, move_by
from uav_bt.errors import DroneError
from uav_bt.types import FlyingState

FLYING, MAX_TILT = "FlyingStateChanged", ("MaxTilt", "MaxTiltChanged")
PAYLOAD = pack([encode(full_name("TakeOff"), {})])
TAKE_OFF = WireFrame(type=FrameType.DATA, buffer=10, sequence=900, payload=PAYLOAD).to_bytes()


def fast() -> Anafi:
    """Return a drone whose time passes ten times faster than real time."""
    bench = Bench()
    update = bench.anafi.update

    def advance() -> None:
        for _ in range(10):
            bench.clock.advance(0.02)
            bench.world.catch_up()
            update()

    bench.anafi.update = advance  # type: ignore[method-assign]
    return bench.anafi


async def connected(server: LoopbackServer | LoopbackDrone) -> Client:
    client = Client(server.ports)
    assert await client.connect()
    await client.ask("common.Common.AllStates", "common.CommonState.AllStatesChanged")
    await client.ask("common.Settings.AllSettings", "common.SettingsState.AllSettingsChanged")
    return client


async def test_only_the_client_that_connected_flies_and_lands() -> None:
    async with serving(fast()) as server:
        client = await connected(server)
        assert (client.card["model.id"], client.answer["proto_v"]) == ("0x0914", 2)
        before = len(client.events)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(TAKE_OFF, (HOST, server.ports.commands))
        await asyncio.sleep(0.2)
        await client.ask(*MAX_TILT, current=12.0)
        assert full_name(FLYING) not in [event.name for event in client.events[before:]]
        client.put(TAKE_OFF)
        await client.wait(FLYING, state="hovering")
        name, values = move_by(1.0)
        done = await client.ask(name, "moveByEnd", **values)
        assert done.values["dX"] == pytest.approx(1.0, abs=0.05)
        await client.ask("Landing", FLYING)
        await client.wait(FLYING, state="landed")
        client.close()


async def test_clients_come_and_go_one_at_a_time() -> None:
    async with serving(fast()) as server:
        (await connected(server)).close()
        dies = await connected(server)
        dies.udp.close()  # killed, but its discovery connection stays open
        first, second = await connected(server), Client(server.ports)
        assert not await second.connect()
        assert second.answer["status"] == -1
        second.close()
        assert (await first.ask(*MAX_TILT, current=12.0)).values["current"] == 12.0
        first.close()
        dies.discovery.close()


async def test_garbage_on_every_port_is_survived() -> None:
    random = Random(7)  # noqa: S311 - not for secrets
    async with serving(fast()) as server:
        client, ports = await connected(server), server.ports
        for _ in range(300):
            client.put(random.randbytes(random.randrange(60)))
        for port in (ports.discovery, ports.control, ports.http):
            for size in (0, 1, 100, 20_000):
                _, writer = await asyncio.open_connection(HOST, port)
                writer.write(random.randbytes(size))
                writer.close()
        await client.ask("TakeOff", FLYING)
        client.close()


def request(**changes: Any) -> bytes:
    asked = {"controller_name": "olympe", "d2c_port": 9988, "proto_v_min": 1, "proto_v_max": 3}
    return json.dumps(asked | changes).encode()


async def test_only_a_request_for_a_link_is_answered() -> None:
    cases = {
        **{request() + end: True for end in (b"", b"\0", b"\n")},
        **{request(d2c_port=port): False for port in (0, True, "9988")},
        **dict.fromkeys((request(proto_v_max=1), b"{}", b"[1]\0", b"\xff\0", b"[" * 5000), False),
    }
    for data, answers in cases.items():
        async with serving(fast()) as server:
            reader, writer = await asyncio.open_connection(HOST, server.ports.control)
            writer.write(data)
            writer.write_eof()
            answer = await reader.read()
            writer.close()
            assert bool(answer) is answers, data[:80]
            assert not answer or json.loads(answer[:-1])["c2d_port"] == server.ports.commands


async def test_a_port_that_cannot_be_bound_is_one_clear_error() -> None:
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        for ports, address, message in (
            (FREE, "203.0.113.1", r"has no address 203\.0\.113\.1"),
            (Ports(discovery=0, control=0, commands=0, http=port), HOST, f"http port {port} of"),
        ):
            with pytest.raises(PortTakenError, match=message):
                async with serving(ports=ports, address=address):
                    pass


FAILURE = r"firmware failed \(ValueError: not finite\).* landed"


@pytest.mark.parametrize(
    ("of", "error", "message"),
    [
        ("update", DroneError("the wings fell off"), "the wings fell off"),
        ("update", ValueError("not finite"), FAILURE),
        ("handle", ValueError("not finite"), FAILURE),
    ],
)
async def test_a_failure_ends_the_service_with_a_message_and_a_landing(
    monkeypatch: pytest.MonkeyPatch, of: str, error: Exception, message: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    drone = LoopbackDrone(DroneSetup(ports=FREE, video=False))
    await drone.start()
    try:
        client = await connected(drone)
        await client.ask("TakeOff", FLYING)
        await client.wait(FLYING, state="hovering")
        monkeypatch.setattr(Anafi, of, fail)
        client.put(TAKE_OFF)
        with pytest.raises(DroneError, match=message):
            await drone.wait()
        if isinstance(error, ValueError):
            assert drone.world.state().flying is FlyingState.LANDED
        client.close()
    finally:
        await drone.close()
