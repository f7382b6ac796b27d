"""Server of the page for picks, for this machine only.

A browser shows the page because OpenCV's headless build has no windows. Programs use the same
requests, for example with `urllib`:

    GET  /state           names, uses, classes, colours, picks; counts by class, images with picks
    GET  /picture/NAME    the image
    GET  /segments/NAME   its super-pixels as PNG: number = red + 256 * green; at most 1152 wide
    GET  /preview/NAME    the teacher's present class map in the classes' colours, PNG of 576x324
    GET  /next?after=NAME the image to pick on next: {image, reason}; image may be null
    POST /pick            {image, x, y, class}: a pick at a pixel
    POST /paint           {image, class, points: [[x, y], ...]}: a pick in each super-pixel
    POST /erase           {image, points: [[x, y], ...]}: no picks in these super-pixels; a single
                          point removes the nearest pick only
    POST /undo            takes back the last of these; without a body

x and y are whole pixels of the image, from its upper left corner. A POST is written to disk before
it is answered. Its answer is that of /state, with the name of the changed image under `image`.
Refused requests have the status 400, 403 or 404 and a line of text.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar, Final, cast
from urllib.parse import parse_qs, unquote, urlsplit

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import read_image
from perception.segmentation.training.pick_session import PickSession, Point
from uav_bt.errors import UavBtError, ValueRangeError
from uav_bt.files import parse_json

_PAGE: Final = Path(__file__).with_name("pick_page.html")
_SHOWN: Final = (".bmp", ".jpeg", ".jpg", ".png", ".webp")  # formats that browsers show
_REQUESTS: Final[dict[str, dict[str, type]]] = {
    "/pick": {"image": str, "x": int, "y": int, "class": str},
    "/paint": {"image": str, "class": str, "points": list},
    "/erase": {"image": str, "points": list},
    "/undo": {},
}
_KINDS: Final = {str: "text", int: "whole number", list: "list"}
_JSON: Final = "application/json"
_TEXT: Final = "text/plain; charset=utf-8"
_LONGEST_REQUEST: Final = 65_536  # bytes; a point takes about ten
_IDLE_S: Final = 10.0  # an idle connection is closed after this time


def make_pick_server(session: PickSession, *, port: int = 0) -> HTTPServer:
    """Return a server for the page, bound to the loopback address; port 0 takes a free one."""

    class Handler(_Handler):
        picks_of = session
        one_at_a_time = threading.Lock()  # a browser asks for several things at a time

    return ThreadingHTTPServer(("127.0.0.1", port), Handler)


class _Handler(BaseHTTPRequestHandler):
    picks_of: ClassVar[PickSession]
    one_at_a_time: ClassVar[threading.Lock]
    timeout = _IDLE_S

    def do_GET(self) -> None:
        self._answer(self._shown, HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        self._answer(self._changed, HTTPStatus.BAD_REQUEST)

    def _answer(self, find: Callable[[], tuple[str, bytes]], refusal: HTTPStatus) -> None:
        """Send what a request asks for, a media type and bytes, or why it is refused."""
        status = HTTPStatus.OK
        try:
            if not self._is_ours():
                status, refusal = HTTPStatus.FORBIDDEN, HTTPStatus.FORBIDDEN
                raise ValueRangeError("only this machine may ask")
            media, body = find()
        except LookupError as error:  # no such place
            status, media, body = HTTPStatus.NOT_FOUND, _TEXT, str(error.args[0]).encode()
        except (UavBtError, OSError, ValueError) as error:
            status, media, body = refusal, _TEXT, str(error).encode()
        try:
            self.send_response(status)
            self.send_header("Content-Type", media)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(body)
        except ConnectionError:
            pass  # the browser no longer waits

    def _shown(self) -> tuple[str, bytes]:
        with self.one_at_a_time:
            session = self.picks_of
            asked = urlsplit(self.path)  # raises ValueError, such as for "//["
            place, _, name = unquote(asked.path)[1:].partition("/")
            if place == "picture":
                return _picture(session.images.file(name))
            if place == "segments":
                ids = session.images.super_pixels(name).ids
                return "image/png", _png(np.stack([ids % 256, ids // 256, 0 * ids], axis=2))
            if place == "preview":
                class_map = session.chooser.class_map(name, session.picks)
                return "image/png", _png(session.classes.colours[class_map])
            if not name and place == "":
                return "text/html; charset=utf-8", _PAGE.read_bytes()
            if not name and place == "state":
                return self._state()
            if not name and place == "next":
                after = parse_qs(asked.query).get("after", [None])[0]
                image, reason = session.chooser.choose(session.picks, after)
                return _JSON, json.dumps({"image": image, "reason": reason}).encode()
            raise LookupError(f"there is no {asked.path}")

    def _changed(self) -> tuple[str, bytes]:
        """Make the change that a request asks for."""
        place = urlsplit(self.path).path
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _LONGEST_REQUEST:
            raise ValueRangeError(f"a request needs a length of at most {_LONGEST_REQUEST} bytes")
        if place not in _REQUESTS:
            raise LookupError(f"there is no {place}")
        body = self.rfile.read(int(length))  # before the lock: a browser may take its time
        with self.one_at_a_time:
            return self._state(self._change(place, body))

    def _change(self, place: str, body: bytes) -> str | None:
        session = self.picks_of
        if place == "/undo":
            return session.undo()
        asked = _fields(body, _REQUESTS[place])
        image = str(asked["image"])
        if place == "/pick":
            session.add(image, asked["x"], asked["y"], asked["class"])
        elif place == "/paint":
            session.paint(image, _points(asked["points"]), asked["class"])
        else:
            session.erase(image, _points(asked["points"]))
        return image

    def _is_ours(self) -> bool:
        # A foreign page whose name resolves to this machine would send that name as the host. For a
        # foreign page that only posts here, the browser sends that page as the origin.
        port = self.connection.getsockname()[1]
        hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}
        origins = {None, *(f"http://{host}" for host in hosts)}
        return self.headers.get("Host") in hosts and self.headers.get("Origin") in origins

    def _state(self, image: str | None = None) -> tuple[str, bytes]:
        session = self.picks_of
        state = {
            "names": list(session.images.uses),
            "uses": list(session.images.uses.values()),
            "classes": session.classes.names,
            "colours": session.classes.colours.tolist(),
            "picks": [asdict(pick) for pick in session.picks],
            "counts": session.counts(),
            "picked_images": session.picked_images(),
            "image": image,
        }
        return _JSON, json.dumps(state).encode()

    def log_message(self, *_: Any) -> None:
        """Log nothing, because the page shows the result."""


def _fields(body: bytes, kinds: dict[str, type]) -> dict[str, Any]:
    """Return the fields of a request's JSON."""
    asked = parse_json(body)
    if not isinstance(asked, dict) or any(type(asked.get(n)) is not k for n, k in kinds.items()):
        fields = ", ".join(f"{name} ({_KINDS[kind]})" for name, kind in kinds.items())
        raise ValueRangeError(f"expected the fields {fields}")
    return asked


def _points(given: list[Any]) -> list[Point]:
    """Return the points of a request."""
    points = [tuple(point) if isinstance(point, list) else () for point in given]
    if not points or any([type(each) for each in point] != [int, int] for point in points):
        raise ValueRangeError("expected points as pairs [x, y] of whole numbers, at least one")
    return cast("list[Point]", points)


def _picture(file: Path) -> tuple[str, bytes]:
    """Return media type and bytes of an image; what browsers do not show becomes PNG."""
    suffix = file.suffix.lower()
    if suffix in _SHOWN:
        return f"image/{suffix[1:].replace('jpg', 'jpeg')}", file.read_bytes()
    return "image/png", _png(read_image(file, colour=True, as_stored=False))


def _png(rgb: NDArray[Any]) -> bytes:
    _, encoded = cv2.imencode(".png", cv2.cvtColor(rgb.astype(np.uint8), cv2.COLOR_RGB2BGR))
    return encoded.tobytes()
