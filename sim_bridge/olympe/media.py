"""Photographs from the drone's web server.

The lists have the format that Parrot's clients read, `GET /api/v1/media/medias/ID`. Nothing that
the drone sends becomes the name of a file here.
"""

from __future__ import annotations

import http.client
import json
import re
import threading
from concurrent.futures import Future
from contextlib import closing
from typing import Any, Final

from uav_bt.errors import DroneError

_MEDIUM: Final = "/api/v1/media/medias/"
_ID: Final = re.compile(r"[A-Za-z0-9_\-]{1,64}")
_URL: Final = re.compile(r"/[A-Za-z0-9_\-]+(?:/[A-Za-z0-9_\-][A-Za-z0-9_.\-]*)+")
_MAX_LIST_BYTES: Final = 1_000_000  # of a medium's description; it has one or two kilobytes
_MAX_PHOTO_BYTES: Final = 64_000_000  # an ANAFI's 21 megapixels take some ten million
_JPEG: Final = b"\xff\xd8"  # how a JPEG file begins


def fetch_photo(host: str, port: int, media: str, limit_s: float) -> bytes:
    """Return the JPEG file of a photograph.

    Args:
        host: Address of the drone's web server.
        port: Its TCP port.
        media: Identifier of the photograph, as the drone reports it when it is saved.
        limit_s: Longest wait for all of it, s.

    Raises:
        DroneError: The drone does not send it in time, or sends another file than a JPEG.
    """
    if not _ID.fullmatch(media):
        got = f"the drone names its photograph '{media:.70}', which is no identifier"
        raise DroneError(f"{got} of letters and digits: fetch it from the memory card")
    photo: Future[bytes] = Future()

    def fetch() -> None:
        try:
            photo.set_result(_fetch(http.client.HTTPConnection(host, port, timeout=limit_s), media))
        except Exception as error:  # noqa: BLE001  # raised below
            photo.set_exception(error)

    # The timeout of a socket is for each packet, so that a slow server would exceed it in total.
    threading.Thread(target=fetch, name="photograph", daemon=True).start()
    try:
        return photo.result(limit_s)
    except TimeoutError as error:
        reason = f"it has not come within {limit_s:g} s"
        raise DroneError(f"its web server at {host}:{port} does not send it: {reason}") from error
    except (OSError, http.client.HTTPException) as error:
        reason = str(error) or type(error).__name__
        raise DroneError(f"its web server at {host}:{port} does not send it: {reason}") from error


def _fetch(connection: http.client.HTTPConnection, media: str) -> bytes:
    with closing(connection):
        listed = _get(connection, f"{_MEDIUM}{media}", _MAX_LIST_BYTES)
        photo = _get(connection, _url_of(listed, media), _MAX_PHOTO_BYTES)
    if not photo.startswith(_JPEG):
        raise DroneError("its web server sends something else than a JPEG file")
    return photo


def _url_of(listed: bytes, media: str) -> str:
    """Return the path of a medium's first JPEG file."""
    try:
        medium: Any = json.loads(listed)
        resources = [one for one in medium["resources"] if one.get("format") == "JPG"]
        url = str(resources[0]["url"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise DroneError(f"its web server lists no JPEG file for '{media}'") from error
    if not _URL.fullmatch(url):
        raise DroneError(f"its web server lists the address '{url:.70}', expected a path of it")
    return url


def _get(connection: http.client.HTTPConnection, url: str, most: int) -> bytes:
    """Return the content at a path, of a largest size in bytes."""
    connection.request("GET", url)
    with connection.getresponse() as answer:
        if answer.status != http.HTTPStatus.OK:
            raise DroneError(f"its web server answers {answer.status} to GET {url}")
        content = answer.read(most + 1)
    if len(content) > most:
        raise DroneError(f"its web server sends more than {most} bytes for {url}")
    if answer.length:
        raise http.client.IncompleteRead(content, answer.length)
    return content
