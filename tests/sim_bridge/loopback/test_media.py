"""Photographs: taken, listed and fetched through the web interface."""

from __future__ import annotations

import asyncio
import json
import struct
import threading
from typing import Any

import cv2
import numpy as np
import pytest

from sim_bridge.loopback import media as media_module
from sim_bridge.loopback.media import MediaStore, Photo, Photographer
from sim_bridge.loopback.world import Location
from sim_bridge.olympe.media import fetch_photo
from tests.sim_bridge.loopback.loopback_client import HOST, PATIENCE_S, serving
from tests.sim_bridge.loopback.video_client import FRAME, assert_quadrants
from uav_bt.errors import DroneError

MEDIAS = "/api/v1/media/medias"
PHOTO = Photo(
    jpeg=b"\xff\xd8 a photograph \xff\xd9",
    thumbnail=b"\xff\xd8 small \xff\xd9",
    size_px=(640, 360),
    taken_utc_s=1_529_154_916.0,
    location=Location(latitude_deg=48.0, longitude_deg=2.0, altitude_m=40.0),
)


async def ask(port: int, path: str, method: str = "GET") -> tuple[str, str, bytes]:
    """Send a request; return status, content type and body of the answer."""
    reader, writer = await asyncio.open_connection(HOST, port)
    writer.write(f"{method} {path} HTTP/1.1\r\n\r\n".encode())
    status, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().rstrip().split("\r\n")
    fields = dict(line.split(": ", 1) for line in lines)
    body = await reader.readexactly(int(fields["Content-Length"]))
    writer.close()
    return status.partition(" ")[2], fields["Content-Type"], body


async def test_a_photograph_is_listed_and_fetched_and_there_is_nothing_else() -> None:
    media = MediaStore()
    media_id = media.add(PHOTO)
    async with serving(media=media) as server:
        port = server.ports.http
        status, kind, body = await ask(port, MEDIAS)
        assert (status, kind) == ("200 OK", "application/json")
        (medium,) = json.loads(body)
        assert medium == json.loads((await ask(port, f"{MEDIAS}/{media_id}"))[2])
        (resource,) = medium["resources"]
        assert medium["media_id"] == resource["media_id"] == media_id == "10000001"
        assert (medium["datetime"], resource["size"]) == ("20180616T131516+0000", len(PHOTO.jpeg))
        assert await ask(port, resource["url"]) == ("200 OK", "image/jpeg", PHOTO.jpeg)
        assert (await ask(port, resource["thumbnail"]))[2] == PHOTO.thumbnail
        assert await asyncio.to_thread(fetch_photo, HOST, port, media_id, PATIENCE_S) == PHOTO.jpeg
        for method, path, refusal in (
            ("GET", "/data/media/../../etc/passwd", "404 Not Found"),
            ("DELETE", MEDIAS, "405 Method Not Allowed"),
        ):
            status, _, body = await ask(port, path, method)
            assert (status, "error" in json.loads(body)) == (refusal, True), path


async def test_a_new_photograph_is_notified_and_pings_are_answered() -> None:
    media = MediaStore()
    async with serving(media=media) as server:
        reader, writer = await asyncio.open_connection(HOST, server.ports.http)
        key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="  # that of RFC 6455, section 1.3
        writer.write(f"GET {MEDIAS[:-6]}notifications HTTP/1.1\r\n{key}\r\n\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode()
        assert "Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in head
        media_id = media.add(PHOTO)
        for name, part in (("media_created", "media"), ("resource_created", "resource")):
            kind, long, size = struct.unpack("!BBH", await reader.readexactly(4))
            assert (kind, long) == (0x81, 126)
            event = json.loads(await reader.readexactly(size))
            assert (event["name"], event["data"][part]["media_id"]) == (name, media_id)
        for opcode, answer in ((0x89, 0x8A), (0x88, 0x88)):
            writer.write(bytes([opcode, 0x82, 1, 2, 3, 4, ord("h") ^ 1, ord("i") ^ 2]))
            assert await reader.readexactly(4) == bytes([answer, 2]) + b"hi"
        assert await reader.read() == b""
        writer.close()


def test_a_card_is_full_when_its_photographs_fill_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(media_module, "MAX_BYTES", len(PHOTO.jpeg))
    media = MediaStore()
    assert not media.full
    media.add(PHOTO)
    assert media.full


def test_a_photograph_shows_what_the_camera_sees() -> None:
    """The camera is used and freed on one thread."""
    threads: list[int] = []

    def seen(frame: Any = None) -> Any:
        threads.append(threading.get_ident())
        return frame

    photographer = Photographer(lambda: seen(FRAME), seen)
    photo = photographer.shoot().result(PATIENCE_S)
    photographer.close()
    photographer.close()
    for jpeg, size_px in ((photo.jpeg, (64, 48)), (photo.thumbnail, (160, 90))):
        shown = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR_RGB)
        assert shown is not None
        assert shown.shape[1::-1] == size_px
        assert_quadrants(shown)
    assert photo.size_px == (64, 48)
    assert (photo.taken_utc_s, photo.location) == (FRAME.captured_utc_s, FRAME.location)
    assert len(threads) == 2
    assert len({*threads, threading.get_ident()}) == 2
    blind = Photographer(lambda: None, lambda: None)
    with pytest.raises(DroneError, match="no image yet"):
        blind.shoot().result(PATIENCE_S)
    blind.close()
