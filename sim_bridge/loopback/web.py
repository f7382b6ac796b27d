"""Web server of the drone: photographs as lists and files, and notifications of new ones."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import struct
from typing import Final

from sim_bridge.loopback.media import Json, MediaStore

MAX_HEAD_BYTES: Final = 16_384
_NOTIFICATIONS: Final = "/api/v1/media/notifications"
_MEDIA: Final = "/api/v1/media/medias"
_PATIENCE_S: Final = 10.0  # timeout of a request, s
_MAGIC: Final = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455, section 1.3
_TEXT, _CLOSE, _PING, _PONG = 0x81, 0x88, 0x89, 0x8A  # whole frames of RFC 6455
_LONG: Final = 126  # length code of frames whose length needs 16 bits


async def serve_web(
    media: MediaStore, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """Answer the requests of one connection until it ends.

    Args:
        media: the stored media.
        reader: reader of the connection; its limit bounds the head of a request.
        writer: writer of the connection.
    """
    while True:
        try:
            async with asyncio.timeout(_PATIENCE_S):
                head = await reader.readuntil(b"\r\n\r\n")
        except (asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            return
        first, *lines = head.decode("latin-1").rstrip().split("\r\n")
        pairs = (line.partition(":") for line in lines)
        fields = {name.strip().lower(): value.strip() for name, _, value in pairs}
        method, _, target = first.rpartition(" ")[0].partition(" ")
        path = target.partition("?")[0]
        if path == _NOTIFICATIONS and "sec-websocket-key" in fields:
            writer.write(_upgrade(fields["sec-websocket-key"]))
            await _notify(media, reader, writer)
            return
        if method != "GET":
            writer.write(_json("405 Method Not Allowed", {"error": f"{method!r} is not simulated"}))
            return
        writer.write(_found(media, path))
        await writer.drain()
        if fields.get("connection", "").lower() == "close":
            return


def _found(media: MediaStore, path: str) -> bytes:
    """Return the answer for a requested path."""
    folder, _, name = path.rpartition("/")
    if path in media.files:
        return _answer("200 OK", "image/jpeg", media.files[path])
    if path.rstrip("/") == _MEDIA:
        return _json("200 OK", list(media.media.values()))
    if folder == _MEDIA and name in media.media:
        return _json("200 OK", media.media[name])
    return _json("404 Not Found", {"error": f"there is no {path}"})


def _json(status: str, content: object) -> bytes:
    return _answer(status, "application/json", json.dumps(content).encode())


def _answer(status: str, kind: str, content: bytes) -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(content)}\r\n\r\n"
    return head.encode() + content


def _upgrade(key: str) -> bytes:
    """Return the answer that makes the connection a websocket."""
    # RFC 6455 requires SHA-1 here; it has no security purpose.
    digest = hashlib.sha1(key.encode("latin-1") + _MAGIC, usedforsecurity=False).digest()
    return (
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
    )


async def _notify(
    media: MediaStore, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """Tell of new photographs, and answer pings, until the client closes the websocket."""

    def tell(event: Json) -> None:
        data = json.dumps(event).encode()
        short = len(data) < _LONG
        size = bytes([len(data)]) if short else struct.pack("!BH", _LONG, len(data))
        writer.write(bytes([_TEXT]) + size + data)

    unsubscribe = media.subscribe(tell)
    try:
        while True:
            opcode, size = await reader.readexactly(2)
            if size & 0x7F >= _LONG:
                return  # clients of this interface send no messages, only pings
            mask = await reader.readexactly(4)
            data = await reader.readexactly(size & 0x7F)
            data = bytes(byte ^ mask[index % 4] for index, byte in enumerate(data))
            if opcode in (_PING, _CLOSE):
                writer.write(bytes([_PONG if opcode == _PING else _CLOSE, len(data)]) + data)
                await writer.drain()
            if opcode == _CLOSE:
                return
    except asyncio.IncompleteReadError:
        return  # the client has gone
    finally:
        unsubscribe()
