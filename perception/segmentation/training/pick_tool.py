"""Tool for picks on photographs: a browser page, served to this machine only.

A browser is used because OpenCV's headless build has no windows. Each click is written to disk
before the page shows it; `undo` removes the last one.
"""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlsplit

import cv2

from perception.segmentation.training.picks import Pick, read_picks, write_picks
from uav_bt.errors import FileError, UavBtError, ValueRangeError
from uav_bt.json_text import parse_json
from uav_bt.lab.classes import LabClasses

_MEDIA: Final = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg"}
_LONGEST_REQUEST: Final = 4096  # bytes; a click takes a hundred
_IDLE_S: Final = 10.0  # an idle connection is closed after this time


class PickSession:
    """The photographs of a folder and the picks on them.

    Args:
        folder: folder of the photographs.
        picks_path: the picks file; existing picks are read.
        classes: classes of the lab.

    Raises:
        FileError: the folder holds no photographs, or the picks file is malformed.
    """

    def __init__(self, folder: Path, picks_path: Path, classes: LabClasses) -> None:
        if not folder.is_dir():
            raise FileError(folder, "is not a folder; give the one that holds the photographs")
        self._folder = folder
        self._path, self.classes = picks_path, classes
        self.names = sorted(p.name for p in folder.iterdir() if p.suffix.lower() in _MEDIA)
        if not self.names:
            raise FileError(folder, f"holds no photographs ({', '.join(_MEDIA)})")
        self.picks = read_picks(picks_path, classes) if picks_path.exists() else []
        self._sizes_px: dict[str, tuple[int, int]] = {}
        self._lock = threading.Lock()  # several tabs may click at once

    def picture(self, name: str) -> Path:
        """Return the file of a listed photograph.

        Raises:
            ValueRangeError: the name is not on the list. Files outside the folder are not served.
        """
        if name not in self.names:
            raise ValueRangeError(f"there is no photograph '{name}'")
        return self._folder / name

    def add(self, name: str, x: int, y: int, class_name: str) -> None:
        """Add and write a click.

        Raises:
            ValueRangeError: the photograph is not on the list, or the pixel lies outside it.
            UnknownNameError: the class is unknown.
            FileError: the photograph cannot be read, or the picks cannot be written.
        """
        self.picture(name)
        pick = Pick(image=name, x=x, y=y, class_id=self.classes.id_of(class_name))
        with self._lock:
            width_px, height_px = self._size_px(name)
            if x >= width_px or y >= height_px:
                raise ValueRangeError(f"({x}, {y}) lies outside of {width_px}x{height_px} pixels")
            write_picks(self._path, [*self.picks, pick], self.classes)
            self.picks.append(pick)

    def _size_px(self, name: str) -> tuple[int, int]:
        path = self.picture(name)
        if name not in self._sizes_px:
            image = cv2.imread(str(path))  # with the EXIF orientation, as in training
            if image is None:
                raise FileError(path, "is not a readable image")
            self._sizes_px[name] = (image.shape[1], image.shape[0])
        return self._sizes_px[name]

    def undo(self) -> None:
        """Remove the last click; without clicks nothing happens."""
        with self._lock:
            if self.picks:
                write_picks(self._path, self.picks[:-1], self.classes)
                self.picks.pop()


def make_pick_server(session: PickSession, *, port: int = 0) -> HTTPServer:
    """Return a server for the page, bound to the loopback address.

    Args:
        session: photographs and picks.
        port: 0 takes a free port; `server.server_port` gives its number.
    """

    class Handler(_Handler):
        picks_of = session

    return ThreadingHTTPServer(("127.0.0.1", port), Handler)


class _Handler(BaseHTTPRequestHandler):
    picks_of: PickSession
    timeout = _IDLE_S

    def do_GET(self) -> None:
        path = unquote(urlsplit(self.path).path)
        if not self._is_ours():
            return
        if path == "/":
            self._send(HTTPStatus.OK, "text/html; charset=utf-8", _PAGE.encode())
        elif path == "/state":
            self._send_state()
        elif path.startswith("/picture/"):
            try:
                file = self.picks_of.picture(path.removeprefix("/picture/"))
                self._send(HTTPStatus.OK, _MEDIA[file.suffix.lower()], file.read_bytes())
            except (UavBtError, OSError) as error:
                self._refuse(HTTPStatus.NOT_FOUND, str(error))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no {path}")

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > _LONGEST_REQUEST:
            self._refuse(HTTPStatus.BAD_REQUEST, "a request needs a length of at most 4096 bytes")
            return
        body = self.rfile.read(int(length))
        try:
            if self.path == "/undo":
                self.picks_of.undo()
            else:
                self.picks_of.add(*_click_of(body))
        except UavBtError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
            return
        self._send_state()

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

    def _send_state(self) -> None:
        state = {
            "names": self.picks_of.names,
            "classes": self.picks_of.classes.names,
            "colours": self.picks_of.classes.colours.tolist(),
            "picks": [asdict(pick) for pick in self.picks_of.picks],
        }
        self._send(HTTPStatus.OK, "application/json", json.dumps(state).encode())

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


def _click_of(body: bytes) -> tuple[str, int, int, str]:
    """Return photograph, column, row and class of a click.

    Raises:
        InputError: the body is not a click.
    """
    click = parse_json(body)
    kinds = {"image": str, "x": int, "y": int, "class": str}
    if not isinstance(click, dict) or any(type(click.get(n)) is not k for n, k in kinds.items()):
        raise ValueRangeError("expected a click: texts image and class, whole numbers x and y")
    return click["image"], click["x"], click["y"], click["class"]


_PAGE: Final = """<!doctype html><title>Picks</title>
<style>body{font:14px sans-serif;margin:8px}canvas{max-width:100%;cursor:crosshair}</style>
<select id=image></select> <select id=label></select> <button id=undo>undo</button>
<span id=note></span><br><canvas id=view></canvas>
<script>
const get = id => document.getElementById(id), picture = new Image();
let state = null;
function show() {
  const view = get("view"), pen = view.getContext("2d");
  view.width = picture.naturalWidth; view.height = picture.naturalHeight;
  pen.drawImage(picture, 0, 0);
  const size = Math.max(3, view.width / 250);
  for (const p of state.picks.filter(p => p.image === get("image").value)) {
    pen.fillStyle = `rgb(${state.colours[p.class_id]})`;
    pen.fillRect(p.x - size, p.y - size, 2 * size, 2 * size);
    pen.strokeRect(p.x - size, p.y - size, 2 * size, 2 * size);
  }
  const count = state.picks.filter(p => p.class_id === get("label").selectedIndex).length;
  get("note").textContent = `${state.picks.length} picks, ${count} of this class`;
}
async function ask(path, body) {
  const answer = await fetch(path, body === undefined ? {} : {method: "POST", body});
  if (!answer.ok) { get("note").textContent = await answer.text(); return; }
  state = await answer.json();
}
function load() { picture.src = "/picture/" + encodeURIComponent(get("image").value); }
picture.onload = show;
get("image").onchange = load;
get("label").onchange = show;
get("undo").onclick = async () => { await ask("/undo", ""); show(); };
get("view").onclick = async event => {
  const view = get("view"), scale = view.width / view.clientWidth;
  await ask("/pick", JSON.stringify({image: get("image").value, class: get("label").value,
    x: Math.floor(event.offsetX * scale), y: Math.floor(event.offsetY * scale)}));
  show();
};
(async () => {
  await ask("/state");
  for (const name of state.names) get("image").add(new Option(name));
  for (const name of state.classes) get("label").add(new Option(name));
  load();
})();
</script>
"""
