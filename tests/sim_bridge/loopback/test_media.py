"""Photographs: taken by a client, listed and fetched through the web interface."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import cv2
import numpy as np
import pytest

from sim_bridge.loopback.firmware.anafi import Anafi
from sim_bridge.loopback.firmware.camera import Shutter
from sim_bridge.loopback.firmware.remote_control import RemoteControl
from sim_bridge.loopback.handshake import SKYCONTROLLER, Identity, Ports
from sim_bridge.loopback.media import MediaStore
from sim_bridge.loopback.messages import message_table
from sim_bridge.loopback.photographer import Photographer
from sim_bridge.loopback.server import LoopbackServer, ServerOptions
from sim_bridge.loopback.twin_camera import TwinCamera
from sim_bridge.olympe.media import fetch_photo
from tests.sim_bridge.loopback.loopback_client import PATIENCE_S, Client
from tests.sim_bridge.loopback.loopback_world import PHOTO, Bench, taken
from tests.sim_bridge.loopback.test_server import LiveWorld
from tests.sim_bridge.loopback.test_twin_world import Stepped

HOST = "127.0.0.23"  # for a port that is chosen before it is bound
MEDIAS = "/api/v1/media/medias"


@asynccontextmanager
async def flying() -> AsyncIterator[tuple[LoopbackServer, Client]]:
    """Yield a drone with a camera, and a connected client."""
    media, table = MediaStore(), message_table()
    anafi = Anafi(LiveWorld(), table, shoot=taken(), media=media)
    options = ServerOptions(ports=Ports(discovery=0, control=0, commands=0, http=0, rtsp=0))
    server = LoopbackServer(anafi, table, options, media=media)
    await server.start()
    client = Client(server.ports)
    try:
        assert await client.connect()
        yield server, client
    finally:
        client.close()
        await server.close()


async def ask(server: LoopbackServer, path: str, method: str = "GET") -> tuple[str, str, bytes]:
    """Send a request; return status, content type and body of the answer."""
    reader, writer = await asyncio.open_connection("127.0.0.1", server.ports.http)
    writer.write(f"{method} {path} HTTP/1.1\r\nConnection: close\r\n\r\n".encode())
    head, _, body = (await reader.read()).partition(b"\r\n\r\n")
    writer.close()
    lines = head.decode().split("\r\n")
    fields = dict(line.split(": ", 1) for line in lines[1:])
    assert int(fields["Content-Length"]) == len(body)
    return lines[0].partition(" ")[2], fields["Content-Type"], body


async def photograph(client: Client) -> str:
    await client.send("camera.take_photo", cam_id=0)
    saved = await client.wait("camera.photo_progress", result="photo_saved")
    return str(saved.values["media_id"])


def test_a_photograph_is_listed_and_fetched() -> None:
    async def run() -> None:
        async with flying() as (server, client):
            media_id = await photograph(client)
            status, kind, body = await ask(server, MEDIAS)
            assert (status, kind) == ("200 OK", "application/json")
            (medium,) = json.loads(body)
            assert medium == json.loads((await ask(server, f"{MEDIAS}/{media_id}"))[2])
            (resource,) = medium["resources"]
            assert medium["media_id"] == resource["media_id"] == media_id == "10000001"
            assert (medium["type"], medium["photo_mode"]) == ("PHOTO", "SINGLE")
            assert medium["datetime"] == "20180616T131516+0000"
            assert medium["gps"] == {"latitude": 48.0, "longitude": 2.0, "altitude": 40.0}
            assert resource["resource_id"] == "100000010001.JPG"
            assert (resource["width"], resource["height"]) == PHOTO.size_px
            assert resource["size"] == len(PHOTO.jpeg)
            assert await ask(server, resource["url"]) == ("200 OK", "image/jpeg", PHOTO.jpeg)
            assert (await ask(server, resource["thumbnail"]))[2] == PHOTO.thumbnail
            md5 = json.loads((await ask(server, "/api/v1/media/md5/100000010001.JPG"))[2])["md5"]
            assert md5 == hashlib.md5(PHOTO.jpeg, usedforsecurity=False).hexdigest()

    asyncio.run(run())


@pytest.mark.parametrize(
    ("path", "event"),
    [
        (MEDIAS, "all_media_removed"),
        (f"{MEDIAS}/10000001", "media_removed"),
        ("/api/v1/media/resources/100000010001.JPG", "resource_removed"),
    ],
)
def test_photographs_are_deleted(path: str, event: str) -> None:
    async def run() -> None:
        async with flying() as (server, client):
            await photograph(client)
            async with listening(server) as heard:
                assert (await ask(server, path, "DELETE"))[0] == "200 OK"
                assert (await heard())["name"] == event
            assert json.loads((await ask(server, MEDIAS))[2]) == []
            assert (await ask(server, "/data/media/100000010001.JPG"))[0] == "404 Not Found"
            expected = "200 OK" if path == MEDIAS else "404 Not Found"
            assert (await ask(server, path, "DELETE"))[0] == expected

    asyncio.run(run())


@pytest.mark.parametrize(
    "path",
    [
        *("/data/media/100000010002.JPG", "/data/media/..%2f..%2fetc%2fpasswd"),
        *("/data/media/../../etc/passwd", "/data/media/", "/data/thumb/10000001"),
        *(f"{MEDIAS}/1", "/api/v1/media/md5/100000010001", "/api/v1/media/resources/"),
    ],
)
def test_there_is_nothing_else(path: str) -> None:
    async def run() -> None:
        async with flying() as (server, client):
            await photograph(client)
            assert (await ask(server, path))[0] == "404 Not Found"

    asyncio.run(run())


@asynccontextmanager
async def listening(server: LoopbackServer) -> AsyncIterator[Callable[[], Any]]:
    """Open the websocket of notifications; yield a function that awaits the next one."""
    reader, writer = await asyncio.open_connection("127.0.0.1", server.ports.http)
    writer.write(
        b"GET /api/v1/media/notifications HTTP/1.1\r\nUpgrade: websocket\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    await reader.readuntil(b"\r\n\r\n")

    async def notification() -> Any:
        async with asyncio.timeout(PATIENCE_S):
            opcode, size = await reader.readexactly(2)
            assert opcode == 0x81
            if size == 126:
                size = int.from_bytes(await reader.readexactly(2), "big")
            return json.loads(await reader.readexactly(size))

    yield notification
    writer.close()


def free_port(*, and_above: int) -> int:
    """Return a free port with another free one at a distance above it.

    It is below the ports that the kernel gives to the connections of other tests.
    """
    for port in range(20_000 + os.getpid() % 5_000, 30_000):
        with socket.socket() as first, socket.socket() as second, suppress(OSError):
            first.bind((HOST, port))
            second.bind((HOST, port + and_above))
            return port
    raise AssertionError(f"no free pair of ports at {HOST}")


def test_behind_a_remote_control_the_photographs_are_a_hundred_ports_higher() -> None:
    port = free_port(and_above=100)

    async def run() -> None:
        media, table, world = MediaStore(), message_table(), LiveWorld()
        media_id = media.add(PHOTO)
        anafi = Anafi(world, table, media=media)
        remote = RemoteControl(anafi, world, table, drone=Identity(), identity=SKYCONTROLLER)
        ports = Ports(discovery=0, control=0, commands=0, http=port, rtsp=0)
        options = ServerOptions(address=HOST, ports=ports)
        server = LoopbackServer(remote, table, options, media=media)
        await server.start()
        try:
            fetched = await asyncio.to_thread(fetch_photo, HOST, port + 100, media_id, PATIENCE_S)
            assert fetched == PHOTO.jpeg
        finally:
            await server.close()

    asyncio.run(run())


def test_a_client_that_listens_hears_of_a_new_photograph() -> None:
    async def run() -> None:
        async with flying() as (server, client):
            async with listening(server) as heard:
                await photograph(client)
                created, resource = await heard(), await heard()
            assert created["name"] == "media_created"
            assert created["data"]["media"]["media_id"] == "10000001"
            assert resource["name"] == "resource_created"
            assert resource["data"]["resource"]["resource_id"] == "100000010001.JPG"

    asyncio.run(run())


@pytest.mark.parametrize(
    ("shoot", "media"),
    [(None, MediaStore()), (taken(RuntimeError("no light")), MediaStore())],
    ids=["no camera", "the camera fails"],
)
def test_a_photograph_that_cannot_be_taken_is_reported(
    shoot: Shutter | None, media: MediaStore
) -> None:
    bench = Bench(shoot=shoot, media=media)
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    assert [one["result"] for one in bench.values("camera.photo_progress")][-1] == "error"
    assert media.media() == []


def test_a_full_memory_card_takes_no_photograph(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_bridge.loopback.media.MAX_BYTES", len(PHOTO.jpeg))
    media = MediaStore()
    bench = Bench(shoot=taken(), media=media)
    for _ in range(2):
        bench.send("camera.take_photo", cam_id=0)
        bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == [*("taking_photo", "photo_taken", "photo_saved", "error_no_storage_space")]
    assert len(media.media()) == 1


def test_a_photograph_shows_what_the_camera_sees() -> None:
    stepped = Stepped("train-a")
    stepped.until(lambda state: state.time_s > 0.5)

    def camera() -> TwinCamera:
        return TwinCamera(
            stepped.world,
            image_size_px=(320, 180),
            seed=1,
            clock=stepped.clock,
            battery=lambda: 1.0,
            gps=False,
        )

    photographer = Photographer(camera)
    photo = photographer.shoot().result(PATIENCE_S)
    photographer.close()
    photographer.close()
    shown = cv2.imdecode(np.frombuffer(photo.jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
    other = camera()
    seen = other.newest()
    other.close()
    assert seen is not None
    assert photo.size_px == (320, 180)
    assert photo.location is None
    assert np.abs(shown.astype(int) - seen.image).mean() < 4.0  # loss of JPEG
    assert seen.image.std() > 10.0
    assert photo.taken_utc_s == pytest.approx(seen.captured_utc_s, abs=5.0)
