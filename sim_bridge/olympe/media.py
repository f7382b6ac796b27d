"""Photographs from the drone's web server.

The lists have the format that Parrot's clients read, `GET /api/v1/media/medias/ID`. Nothing that
the drone sends becomes the name of a file here.
"""

from __future__ import annotations

import http.client
import json
import re
import time
from collections.abc import Callable
from contextlib import closing
from typing import Any, Final

from uav_bt.errors import DroneError

_MEDIUM: Final = "/api/v1/media/medias/"
_ID: Final = re.compile(r"[A-Za-z0-9_\-]{1,64}")
_URL: Final = re.compile(r"/[A-Za-z0-9_\-]+(?:/[A-Za-z0-9_\-][A-Za-z0-9_.\-]*)+")
_MAX_LIST_BYTES: Final = 1_000_000  # of a medium's description; it has one or two kilobytes
_MAX_PHOTO_BYTES: Final = 64_000_000  # an ANAFI's 21 megapixels take some ten million
_CHUNK_BYTES: Final = 65_536
_JPEG: Final = b"\xff\xd8"  # how a JPEG file begins


def fetch_photo(
    host: str, port: int, media: str, limit_s: float, now: Callable[[], float] = time.monotonic
) -> bytes:
    """Return the JPEG file of a photograph.

    Args:
        host: Address of the drone's web server.
        port: Its TCP port.
        media: Identifier of the photograph, as the drone reports it when it is saved.
        limit_s: Longest wait for all of it, s.
        now: Monotonic clock, s.

    Raises:
        DroneError: The drone does not send it in time, or sends another file than a JPEG.
    """
    if not _ID.fullmatch(media):
        raise DroneError(f"the drone names its photograph '{media:.70}', which is no identifier")
    server = _Server(host, port, now() + limit_s, now)
    listed = server.get(f"{_MEDIUM}{media}", _MAX_LIST_BYTES)
    photo = server.get(_url_of(listed, media), _MAX_PHOTO_BYTES)
    if not photo.startswith(_JPEG):
        raise DroneError("its web server sends something else than a JPEG file")
    return photo


def _url_of(listed: bytes, media: str) -> str:
    """Return the path of a medium's first JPEG file.

    Raises:
        DroneError: The description of the medium names none.
    """
    try:
        medium: Any = json.loads(listed)
        resources = [one for one in medium["resources"] if one.get("format") == "JPG"]
        url = str(resources[0]["url"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise DroneError(f"its web server lists no JPEG file for '{media}'") from error
    if not _URL.fullmatch(url):
        raise DroneError(f"its web server lists the address '{url:.70}', expected a path of it")
    return url


class _Server:
    """The drone's web server, until a time."""

    def __init__(self, host: str, port: int, until_s: float, now: Callable[[], float]) -> None:
        self._host, self._port = host, port
        self._until_s = until_s
        self._now = now

    def get(self, url: str, most: int) -> bytes:
        """Return the content at a path.

        Args:
            url: The path.
            most: Largest size, bytes.

        Raises:
            DroneError: There is no answer in time, or no such path, or its content is too large.
        """
        try:
            return self._get(url, most)
        except (OSError, http.client.HTTPException) as error:
            where, reason = f"{self._host}:{self._port}", str(error) or type(error).__name__
            raise DroneError(f"its web server at {where} does not send it: {reason}") from error

    def _get(self, url: str, most: int) -> bytes:
        timeout_s = self._left_s()
        connection = http.client.HTTPConnection(self._host, self._port, timeout=timeout_s)
        with closing(connection):
            connection.request("GET", url)
            with connection.getresponse() as answer:
                if answer.status != http.HTTPStatus.OK:
                    raise DroneError(f"its web server answers {answer.status} to GET {url}")
                content = bytearray()
                while chunk := answer.read1(_CHUNK_BYTES):
                    content += chunk
                    if len(content) > most:
                        raise DroneError(f"its web server sends more than {most} bytes for {url}")
                    self._left_s()  # a slow server sends something before every timeout
                if answer.length:
                    raise http.client.IncompleteRead(b"", answer.length)
                return bytes(content)

    def _left_s(self) -> float:
        left_s = self._until_s - self._now()
        if left_s <= 0.0:
            raise TimeoutError("timed out")
        return left_s
