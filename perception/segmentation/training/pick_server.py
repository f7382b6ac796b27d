"""Server of the page for picks, for this machine only.

A browser shows the page because OpenCV's headless build has no windows. Programs use the same
requests, for example with `urllib`:

    GET  /state           names, uses, classes, colours, picks; counts by class, images with picks
    GET  /picture/NAME    the image
    GET  /segments/NAME   its super-pixels as PNG: number = red + 256 * green; at most 1152 wide
    GET  /preview/NAME    the teacher's present class map in the classes' colours, PNG of 576x324
    GET  /next?after=NAME the image to pick on next: {image, reason, margin}; image may be null
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
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qs, unquote, urlsplit

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.image_files import read_image
from perception.segmentation.training.next_image import ImageChooser
from perception.segmentation.training.pick_session import PickSession, Point
from uav_bt.errors import UavBtError, ValueRangeError
from uav_bt.files import parse_json

_PAGE: Final = Path(__file__).with_name("pick_page.html")
_MEDIA: Final = {
    ".bmp": "image/bmp",
    ".jpeg": "image/jpeg",
    ".jpg": "image/jpeg",
    ".png": "image/png",
    ".webp": "image/webp",
}
_REQUESTS: Final[dict[str, dict[str, type]]] = {
    "/pick": {"image": str, "x": int, "y": int, "class": str},
    "/paint": {"image": str, "class": str, "points": list},
    "/erase": {"image": str, "points": list},
}
_KINDS: Final = {str: "text", int: "whole number", list: "list"}
_JSON: Final = "application/json"
_LONGEST_REQUEST: Final = 65_536  # bytes; a point takes about ten
_IDLE_S: Final = 10.0  # an idle connection is closed after this time


def make_pick_server(session: PickSession, *, port: int = 0) -> HTTPServer:
    """Return a server for the page, bound to the loopback address.

    Args:
        session: Images and picks.
        port: 0 takes a free port; `server.server_port` gives its number.
    """

    class Handler(_Handler):
        picks_of = session
        chooser = ImageChooser(session.images, session.classes)

    return ThreadingHTTPServer(("127.0.0.1", port), Handler)


class _Handler(BaseHTTPRequestHandler):
    picks_of: PickSession
    chooser: ImageChooser
    timeout = _IDLE_S

    def do_GET(self) -> None:
        if not self._is_ours():
            return
        try:
            asked = urlsplit(self.path)  # raises ValueError, such as for "//["
            place, _, name = unquote(asked.path)[1:].partition("/")
            if place == "" and not name:
                self._send(HTTPStatus.OK, "text/html; charset=utf-8", _PAGE.read_bytes())
            elif place == "state" and not name:
                self._send_state()
            elif place == "next" and not name:
                after = parse_qs(asked.query).get("after", [None])[0]
                chosen = self.chooser.choose(self.picks_of.picks, after)
                self._send(HTTPStatus.OK, _JSON, json.dumps(asdict(chosen)).encode())
            elif place == "picture":
                self._send(HTTPStatus.OK, *_picture(self.picks_of.images.file(name)))
            elif place == "segments":
                ids = self.picks_of.images.super_pixels(name).ids
                self._send_png(np.stack([ids % 256, ids // 256, 0 * ids], axis=2))
            elif place == "preview":
                class_map = self.chooser.class_map(name, self.picks_of.picks)
                self._send_png(self.picks_of.classes.colours[class_map])
            else:
                self._refuse(HTTPStatus.NOT_FOUND, f"there is no {asked.path}")
        except ConnectionError:
            pass  # the browser no longer waits
        except (UavBtError, OSError, ValueError) as error:
            self._refuse(HTTPStatus.NOT_FOUND, str(error))

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _LONGEST_REQUEST:
            message = f"a request needs a length of at most {_LONGEST_REQUEST} bytes"
            self._refuse(HTTPStatus.BAD_REQUEST, message)
            return
        try:
            image = self._changed(self.rfile.read(int(length)))
            if image is not None:
                self._send_state(image or None)
        except ConnectionError:
            pass
        except UavBtError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def _changed(self, body: bytes) -> str | None:
        """Make the change that a request asks for.

        Returns:
            The changed image, an empty text without one; None if the request was refused.
        """
        session, place = self.picks_of, urlsplit(self.path).path
        if place == "/undo":
            return session.undo() or ""
        if place not in _REQUESTS:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no {place}")
            return None
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
        if self.headers.get("Host") in hosts and self.headers.get("Origin") in origins:
            return True
        self._refuse(HTTPStatus.FORBIDDEN, "only this machine may ask")
        return False

    def _send_state(self, image: str | None = None) -> None:
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
        self._send(HTTPStatus.OK, _JSON, json.dumps(state).encode())

    def _send_png(self, rgb: NDArray[Any]) -> None:
        self._send(HTTPStatus.OK, "image/png", _png(rgb.astype(np.uint8)))

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        self._send(status, "text/plain; charset=utf-8", message.encode())

    def _send(self, status: HTTPStatus, media: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", media)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Log nothing, because the page shows the result."""


def _fields(body: bytes, kinds: dict[str, type]) -> dict[str, Any]:
    """Return the fields of a request.

    Raises:
        InputError: The body is no JSON, or a field is absent or of another type.
    """
    asked = parse_json(body)
    if not isinstance(asked, dict) or any(type(asked.get(n)) is not k for n, k in kinds.items()):
        fields = ", ".join(f"{name} ({_KINDS[kind]})" for name, kind in kinds.items())
        raise ValueRangeError(f"expected the fields {fields}")
    return asked


def _points(given: list[Any]) -> list[Point]:
    """Return the points of a request.

    Raises:
        ValueRangeError: It has no point, or one is not a pair of whole numbers.
    """
    if not given or any(
        not isinstance(point, list) or [type(each) for each in point] != [int, int]
        for point in given
    ):
        raise ValueRangeError("expected points as pairs [x, y] of whole numbers, at least one")
    return [(x, y) for x, y in given]


def _picture(file: Path) -> tuple[str, bytes]:
    """Return media type and bytes of an image; what browsers do not show becomes PNG."""
    media = _MEDIA.get(file.suffix.lower())
    if media is not None:
        return media, file.read_bytes()
    return "image/png", _png(read_image(file, colour=True, as_stored=False))


def _png(rgb: NDArray[np.uint8]) -> bytes:
    _, encoded = cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    return encoded.tobytes()
