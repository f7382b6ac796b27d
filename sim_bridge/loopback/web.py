"""Web server of the drone: media as lists and files, and notifications of changes."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import struct
from collections.abc import Mapping
from typing import Final

from sim_bridge.loopback.media import Json, MediaStore

MAX_HEAD_BYTES: Final = 16_384
WEBSOCKET_PATH: Final = "/api/v1/media/notifications"
_MEDIA: Final = "/api/v1/media/medias"
_RESOURCE: Final = "/api/v1/media/resources/"
_MD5: Final = "/api/v1/media/md5/"
_FILE: Final = "/data/media/"
_THUMBNAIL: Final = "/data/thumb/"
_PATIENCE_S: Final = 10.0  # timeout of a request, s
_MAGIC: Final = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455, section 1.3
_MAX_MESSAGE_BYTES: Final = 65_536
_MAX_WAITING_BYTES: Final = 2**20  # limit of notifications that a client has not read
_TEXT, _CLOSE, _PING, _PONG = 1, 8, 9, 10  # opcodes of RFC 6455
_FINAL: Final = 0x80
_LONG, _HUGE = 126, 127  # length codes of frames whose length needs 16 or 64 bits

_OK: Final = "200 OK"
_NOT_FOUND: Final = "404 Not Found"
_NOT_ALLOWED: Final = "405 Method Not Allowed"


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
        request = _parse(head)
        if request is None:
            await _answer(writer, "400 Bad Request", {"error": "this is not an HTTP request"})
            return
        method, path, fields = request
        if path == WEBSOCKET_PATH and "sec-websocket-key" in fields:
            await _upgrade(writer, fields["sec-websocket-key"])
            unsubscribe = media.subscribe(lambda event: _notify(writer, event))
            try:
                await _listen(reader, writer)
            finally:
                unsubscribe()
            return
        if fields.get("content-length", "0") != "0" or "transfer-encoding" in fields:
            await _answer(writer, _NOT_ALLOWED, {"error": "uploads are not supported"})
            return
        if method == "GET":
            await _answer(writer, *_found(media, path))
        elif method == "DELETE":
            await _answer(writer, *_deleted(media, path))
        else:
            await _answer(writer, _NOT_ALLOWED, {"error": f"{method} is not simulated"})
        if fields.get("connection", "").lower() == "close":
            return


def _parse(head: bytes) -> tuple[str, str, Mapping[str, str]] | None:
    lines = head.decode("latin-1").split("\r\n")
    words = lines[0].split()
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        return None
    pairs = (line.partition(":") for line in lines[1:] if ":" in line)
    fields = {name.strip().lower(): value.strip() for name, _, value in pairs}
    return words[0], words[1].partition("?")[0], fields


def _found(media: MediaStore, path: str) -> tuple[str, object]:
    """Return status and content for a requested path."""
    folder, slash, name = path.rpartition("/")
    if path.rstrip("/") == _MEDIA:
        return _OK, media.media()
    found: Json | bytes | None = None
    if folder == _MEDIA:
        found = media.medium(name)
    elif folder + slash == _MD5:
        found = media.checksum(name)
    elif folder + slash in (_FILE, _THUMBNAIL):
        found = media.file(name, thumbnail=folder + slash == _THUMBNAIL)
    return (_NOT_FOUND, {"error": f"there is no {path}"}) if found is None else (_OK, found)


def _deleted(media: MediaStore, path: str) -> tuple[str, object]:
    """Delete the media at a path and return status and content."""
    folder, slash, name = path.rpartition("/")
    if path.rstrip("/") == _MEDIA:
        media.clear()
        return _OK, []
    gone = (folder == _MEDIA and media.remove(name)) or (
        folder + slash == _RESOURCE and media.remove_resource(name)
    )
    return (_OK, []) if gone else (_NOT_FOUND, {"error": f"there is no {path}"})


async def _answer(writer: asyncio.StreamWriter, status: str, content: object) -> None:
    """Answer a request with a JPEG or with JSON."""
    image = isinstance(content, bytes)
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {'image/jpeg' if image else 'application/json'}\r\n"
        f"Content-Length: {len(data)}\r\n\r\n"
    )
    writer.write(head.encode() + data)
    await writer.drain()


def _notify(writer: asyncio.StreamWriter, event: Json) -> None:
    """Send an event through a websocket; a client that does not read is disconnected."""
    if writer.transport.get_write_buffer_size() > _MAX_WAITING_BYTES:
        writer.transport.abort()
        return
    data = json.dumps(event).encode()
    head = [_FINAL | _TEXT, len(data)] if len(data) < _LONG else [_FINAL | _TEXT, _LONG]
    size = b"" if len(data) < _LONG else struct.pack(">H", len(data))
    writer.write(bytes(head) + size + data)


async def _upgrade(writer: asyncio.StreamWriter, key: str) -> None:
    # RFC 6455 requires SHA-1 here; it has no security purpose.
    digest = hashlib.sha1(key.encode("latin-1") + _MAGIC, usedforsecurity=False).digest()
    writer.write(
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
    )
    await writer.drain()


async def _listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve a websocket: answer pings until the client closes it."""
    while True:
        try:
            opcode, message = await _read_message(reader)
        except (asyncio.IncompleteReadError, ValueError):
            return
        if opcode == _PING:
            writer.write(bytes([_FINAL | _PONG, len(message)]) + message)
        elif opcode == _CLOSE:
            writer.write(bytes([_FINAL | _CLOSE, len(message)]) + message)
        await writer.drain()
        if opcode == _CLOSE:
            return


async def _read_message(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    first, second = await reader.readexactly(2)
    size = second & 0x7F
    if size == _LONG:
        (size,) = struct.unpack(">H", await reader.readexactly(2))
    elif size == _HUGE:
        (size,) = struct.unpack(">Q", await reader.readexactly(8))
    if size > _MAX_MESSAGE_BYTES or (first & 0x0F in (_CLOSE, _PING, _PONG) and size >= _LONG):
        raise ValueError(f"a websocket message of {size} bytes is too long")
    mask = await reader.readexactly(4) if second & 0x80 else bytes(4)
    data = await reader.readexactly(size)
    return first & 0x0F, bytes(byte ^ mask[index % 4] for index, byte in enumerate(data))
