"""The drone's web server, as far as clients wait for it: an empty media list and its notifications.

Photos and recordings are not kept, so the list stays empty and nothing is ever notified; a client
that listens stays connected, and its pings are answered.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import struct
from collections.abc import Mapping
from typing import Final

MAX_HEAD_BYTES: Final = 16_384
WEBSOCKET_PATH: Final = "/api/v1/media/notifications"
_MEDIA_PATH: Final = "/api/v1/media/medias"
_PATIENCE_S: Final = 10.0  # s for a request to arrive
_MAGIC: Final = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455, section 1.3
_MAX_MESSAGE_BYTES: Final = 65_536
_CLOSE, _PING, _PONG = 8, 9, 10  # opcodes of RFC 6455
_FINAL: Final = 0x80
_LONG, _HUGE = 126, 127  # a frame's length does not fit into its first seven bits


async def serve_web(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answer one connection's requests until it ends.

    Args:
        reader: the connection's; its limit bounds a request's head.
        writer: the connection's.
    """
    while True:
        try:
            async with asyncio.timeout(_PATIENCE_S):
                head = await reader.readuntil(b"\r\n\r\n")
        except (asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            return
        request = _parse(head)
        if request is None:
            await _answer(writer, "400 Bad Request", {"error": "this is no HTTP request"})
            return
        method, path, fields = request
        if path == WEBSOCKET_PATH and "sec-websocket-key" in fields:
            await _upgrade(writer, fields["sec-websocket-key"])
            await _listen(reader, writer)
            return
        if fields.get("content-length", "0") != "0" or "transfer-encoding" in fields:
            await _answer(writer, "405 Method Not Allowed", {"error": "nothing is stored here"})
            return
        await _respond(writer, method, path)
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


async def _respond(writer: asyncio.StreamWriter, method: str, path: str) -> None:
    if path.rstrip("/") != _MEDIA_PATH:
        await _answer(writer, "404 Not Found", {"error": f"{path} is not simulated"})
    elif method not in ("GET", "DELETE"):
        await _answer(writer, "405 Method Not Allowed", {"error": f"{method} is not simulated"})
    else:
        await _answer(writer, "200 OK", [])


async def _answer(writer: asyncio.StreamWriter, status: str, body: object) -> None:
    data = json.dumps(body).encode()
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: application/json\r\n"
        f"Content-Length: {len(data)}\r\n\r\n"
    )
    writer.write(head.encode() + data)
    await writer.drain()


async def _upgrade(writer: asyncio.StreamWriter, key: str) -> None:
    # RFC 6455 asks for SHA-1 here; it protects nothing.
    digest = hashlib.sha1(key.encode("latin-1") + _MAGIC, usedforsecurity=False).digest()
    writer.write(
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
    )
    await writer.drain()


async def _listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Keep a websocket open: answer pings, and leave when asked to."""
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
