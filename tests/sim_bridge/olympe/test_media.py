"""Photographs from the drone's web server."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

from sim_bridge.olympe import media
from sim_bridge.olympe.media import fetch_photo
from uav_bt.errors import DroneError

PHOTO = b"\xff\xd8 a photograph"
LISTED = "/api/v1/media/medias/100"


def medium(url: str = "/data/media/1000001.JPG", format_: str = "JPG") -> bytes:
    return json.dumps({"resources": [{"format": format_, "url": url}]}).encode()


class Web:
    """A web server with fixed answers."""

    def __init__(self) -> None:
        self.pages: dict[str, bytes] = {LISTED: medium(), "/data/media/1000001.JPG": PHOTO}
        self.short = 0  # bytes that are announced and not sent
        self.host, self.port = "127.0.0.1", 0

    def fetch(self, name: str = "100", limit_s: float = 30.0, **how: Any) -> bytes:
        return fetch_photo(self.host, self.port, name, limit_s, **how)


@pytest.fixture
def web() -> Iterator[Web]:
    pages = Web()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            content = pages.pages.get(self.path)
            self.send_response(404 if content is None else 200)
            self.send_header("Content-Length", str(len(content or b"") + pages.short))
            self.end_headers()
            self.wfile.write(content or b"")

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            del format, args

    server = ThreadingHTTPServer((pages.host, 0), Handler)
    pages.port = server.server_address[1]
    thread = threading.Thread(target=partial(server.serve_forever, 0.01), daemon=True)
    thread.start()
    yield pages
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_photograph_is_fetched_by_its_identifier(web: Web) -> None:
    assert web.fetch() == PHOTO


def test_of_several_files_the_jpeg_is_taken(web: Web) -> None:
    files = [{"format": "DNG", "url": "/data/media/a.DNG"}, {"format": "JPG", "url": "/d/b.JPG"}]
    web.pages |= {LISTED: json.dumps({"resources": files}).encode(), "/d/b.JPG": PHOTO}
    assert web.fetch() == PHOTO


@pytest.mark.parametrize(
    ("pages", "words"),
    [
        ({LISTED: None}, "answers 404 to GET /api/v1/media/medias/100"),
        ({"/data/media/1000001.JPG": None}, "answers 404 to GET /data/media/1000001.JPG"),
        ({"/data/media/1000001.JPG": b"<html>"}, "something else than a JPEG file"),
        ({LISTED: b"{"}, "lists no JPEG file for '100'"),
        ({LISTED: b"[]"}, "lists no JPEG file for '100'"),
        ({LISTED: b'{"resources": []}'}, "lists no JPEG file for '100'"),
        ({LISTED: b'{"resources": [1]}'}, "lists no JPEG file for '100'"),
        ({LISTED: medium(format_="DNG")}, "lists no JPEG file for '100'"),
        ({LISTED: medium("http://127.0.0.9/a.JPG")}, "expected a path of it"),
        ({LISTED: medium("/data/../a.JPG")}, "expected a path of it"),
        ({LISTED: medium("/data/a.JPG\r\nX: 1")}, "expected a path of it"),
    ],
)
def test_what_the_drone_sends_is_checked(
    web: Web, pages: dict[str, bytes | None], words: str
) -> None:
    merged = {**web.pages, **pages}
    web.pages = {path: content for path, content in merged.items() if content is not None}
    with pytest.raises(DroneError) as caught:
        web.fetch()
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["", "../x", "1/2", "1 2", "1\r\n", "9" * 65])
def test_an_odd_identifier_is_never_asked_for(web: Web, name: str) -> None:
    with pytest.raises(DroneError, match="is no identifier"):
        web.fetch(name)


def test_a_photograph_that_ends_early_or_never_is_refused(
    web: Web, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(media, "_MAX_PHOTO_BYTES", len(PHOTO) - 1)
    with pytest.raises(DroneError, match="sends more than 14 bytes"):
        web.fetch()
    web.short = 1
    with pytest.raises(DroneError, match="does not send it: "):
        web.fetch(limit_s=5.0)


def test_the_time_limit_holds_for_all_of_it(web: Web) -> None:
    times = iter([0.0, *[1.0] * 2, *[31.0] * 20])
    with pytest.raises(DroneError, match="does not send it: timed out"):
        web.fetch(now=lambda: next(times))


def test_no_server_is_an_error(web: Web) -> None:
    with pytest.raises(DroneError, match=r"web server at 127.0.0.1:1 does not send it"):
        fetch_photo(web.host, 1, "100", 5.0)
