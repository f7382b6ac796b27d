"""Picking in the browser: the session and its server."""

import json
import math
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.segmentation.training.pick_images import find_super_pixels
from perception.segmentation.training.pick_server import make_pick_server
from perception.segmentation.training.pick_session import PickSession
from perception.segmentation.training.picks import Pick, read_picks
from tests.paper_lab import CLASSES
from tests.perception.segmentation import pick_places
from tests.perception.segmentation.pick_places import CRATE, FLOOR, PLACE, session_of
from tests.worlds.tables import cases
from uav_bt.errors import FileError

LEFT = [(10, y) for y in range(0, 90, 2)]  # a stroke down the floor
MIDDLE = [(x, 45) for x in range(0, 160, 2)]  # a stroke across floor and crate


@pytest.fixture
def session(tmp_path: Path) -> PickSession:
    pick_places.write_image(tmp_path / "frames" / "a.png", FLOOR, CRATE)
    pick_places.write_image(tmp_path / "frames" / "b.png", CRATE, FLOOR)
    return session_of(tmp_path, {"a.png": "train", "b.png": "check"})


def _regions(session: PickSession, image: str = "a.png") -> list[int]:
    found = session.images.super_pixels(image)
    return [found.at(pick.x, pick.y) for pick in session.picks if pick.image == image]


def test_a_stroke_gives_each_super_pixel_one_pick(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    found = session.images.super_pixels("a.png")
    assert _regions(session) == list(dict.fromkeys(found.at(x, y) for x, y in LEFT))
    assert len(session.picks) > 5
    for pick, region in zip(session.picks, _regions(session), strict=True):
        touched = [point for point in LEFT if found.at(*point) == region]
        middle = found.innermost_of(region)
        assert (pick.x, pick.y) in touched
        assert math.dist((pick.x, pick.y), middle) == min(math.dist(p, middle) for p in touched)
    assert read_picks(session.path, PLACE) == session.picks
    assert session.counts() == {"wall": 0, "floor": len(session.picks), "crate": 0, "pad": 0}
    assert session.picked_images() == {"train": 1, "check": 0}
    before = list(session.picks)
    session.paint("a.png", LEFT[:5], "floor")  # again: it changes nothing, and is no stroke
    assert session.picks == before
    session.undo()
    assert session.picks == []


def test_another_class_replaces_the_pick(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    session.add("b.png", 1, 1, "pad")
    session.paint("a.png", MIDDLE, "crate")
    regions = _regions(session)
    assert len(regions) == len(set(regions))
    assert {PLACE.names[pick.class_id] for pick in session.picks} == {"floor", "crate", "pad"}
    crossed = regions.index(session.images.super_pixels("a.png").at(10, 45))
    mine = [pick for pick in session.picks if pick.image == "a.png"]
    assert mine[crossed].class_id == PLACE.id_of("crate")


def test_the_eraser_removes_the_picks_of_its_super_pixels(session: PickSession) -> None:
    session.paint("a.png", MIDDLE, "crate")
    session.paint("b.png", MIDDLE, "crate")
    found = session.images.super_pixels("a.png")
    gone = {found.at(x, y) for x, y in MIDDLE[:20]}
    before = len(_regions(session, "b.png"))
    session.erase("a.png", MIDDLE[:20])
    assert gone.isdisjoint(_regions(session))
    assert _regions(session)
    assert len(_regions(session, "b.png")) == before
    assert read_picks(session.path, PLACE) == session.picks


def test_a_click_takes_the_nearest_pick_only(session: PickSession) -> None:
    x, y = session.images.super_pixels("a.png").innermost_of(0)
    session.add("a.png", x, y, "floor")
    session.add("a.png", x + 1, y, "crate")
    session.erase("a.png", [(x + 1, y)])
    assert [pick.class_id for pick in session.picks] == [PLACE.id_of("floor")]
    session.add("a.png", x, y, "crate")
    session.paint("a.png", [(x, y)], "floor")  # of two classes, one of them this one
    assert [pick.class_id for pick in session.picks] == [PLACE.id_of("floor")]


def test_undo_brings_back_what_a_stroke_replaced(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    painted = list(session.picks)
    session.erase("a.png", LEFT[:3])
    session.paint("a.png", MIDDLE, "crate")
    assert (session.undo(), session.undo()) == ("a.png", "a.png")
    assert session.picks == painted
    assert read_picks(session.path, PLACE) == painted
    assert (session.undo(), session.undo()) == ("a.png", None)
    assert session.picks == []
    assert not session.path.exists()


def test_earlier_picks_are_gone_on_with(session: PickSession, tmp_path: Path) -> None:
    session.paint("a.png", LEFT, "floor")
    again = session_of(tmp_path, {"a.png": "train", "b.png": "check"})
    assert again.undo() is None  # the strokes of another session stay
    again.add("b.png", 2, 2, "crate")
    added = Pick(image="b.png", x=2, y=2, class_id=2)
    assert read_picks(session.path, PLACE) == [*session.picks, added]
    # Picks of another program are not overwritten.
    with pytest.raises(FileError, match="was changed by another program"):
        session.add("a.png", 5, 5, "floor")
    assert read_picks(session.path, PLACE) == again.picks
    # A pick outside its image does not stop a stroke.
    session.path.write_text("image,x,y,class,origin\na.png,500,5,floor,hand\n", encoding="utf-8")
    again = session_of(tmp_path, {"a.png": "train"})
    again.paint("a.png", LEFT, "crate")
    again.erase("a.png", LEFT)
    assert [pick.x for pick in again.picks] == [500]


# --- the page for picks ---------------------------------------------------------------------------

USES = {"a.png": "train", "b.jpg": "train", "d.tif": "check"}
CLICK = {"image": "a.png", "x": 3, "y": 4, "class": "carpet"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    images = tmp_path / "images"
    images.mkdir()
    for name in USES:
        cv2.imwrite(str(images / name), np.full((9, 16, 3), 90, np.uint8))
    (images / "notes.txt").write_text("not a picture", encoding="utf-8")
    (tmp_path / "secret.png").write_bytes(b"secret")
    return images


@pytest.fixture
def page(folder: Path, tmp_path: Path) -> Iterator[HTTPConnection]:
    server = make_pick_server(PickSession(folder, tmp_path / "picks.csv", CLASSES, USES))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=120)
    yield connection
    connection.close()
    server.shutdown()
    thread.join()
    server.server_close()


def _ask(page: HTTPConnection, path: str, body: str | None = None, **headers: str) -> tuple:
    page.request("GET" if body is None else "POST", path, body=body, headers=headers)
    answer = page.getresponse()
    return answer.status, answer.read()


def _send(page: HTTPConnection, path: str, **changes: object) -> dict:
    """Return the state after a click on 'a.png', or after a request with other fields."""
    status, body = _ask(page, path, json.dumps({**CLICK, **changes}))
    assert status == 200
    return json.loads(body)


def _decoded(png: bytes) -> NDArray[np.uint8]:
    """Return the RGB image of a PNG file's bytes."""
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_the_page_and_its_images_are_served(page: HTTPConnection, folder: Path) -> None:
    status, body = _ask(page, "/")
    assert (status, b"<canvas" in body, b'rel="icon"' in body) == (200, True, True)
    assert _ask(page, "/picture/b.jpg") == (200, (folder / "b.jpg").read_bytes())
    state = json.loads(_ask(page, "/state")[1])
    assert dict(zip(state["names"], state["uses"], strict=True)) == USES
    assert state["classes"] == list(CLASSES.names)
    assert state["colours"] == CLASSES.colours.tolist()
    assert state["picked_images"] == {"train": 0, "check": 0}
    # An image that browsers do not show becomes PNG.
    status, body = _ask(page, "/picture/d.tif")
    assert (status, body[:4]) == (200, b"\x89PNG")
    assert (_decoded(body) == 90).all()


def test_segments_number_the_super_pixels(page: HTTPConnection, folder: Path) -> None:
    rgb = np.random.default_rng(0).integers(0, 255, (90, 90, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "a.png"), rgb)
    red, green, blue = np.moveaxis(_decoded(_ask(page, "/segments/a.png")[1]).astype(int), 2, 0)
    ids = red + 256 * green
    assert np.array_equal(ids, find_super_pixels(rgb[..., ::-1].copy()).ids)
    assert ids.max() > 255
    assert not blue.any()


def test_clicks_and_strokes_are_on_disk_and_undone(page: HTTPConnection, tmp_path: Path) -> None:
    _send(page, "/pick")
    assert len(_send(page, "/pick", image="b.jpg")["picks"]) == 2
    first, second = read_picks(tmp_path / "picks.csv", CLASSES)
    assert (first, second.image) == (Pick(image="a.png", x=3, y=4, class_id=1), "b.jpg")
    state = _send(page, "/paint", image="d.tif", points=[[1, 1], [14, 7]])
    assert (state["image"], state["counts"]["carpet"]) == ("d.tif", 4)
    assert state["picked_images"] == {"train": 2, "check": 1}
    state = _send(page, "/erase", image="d.tif", points=[[1, 1]])
    assert state["counts"]["carpet"] == 3
    for image, carpets in (("d.tif", 4), ("d.tif", 2), ("b.jpg", 1)):
        state = json.loads(_ask(page, "/undo", "")[1])
        assert (state["image"], state["counts"]["carpet"]) == (image, carpets)
    assert read_picks(tmp_path / "picks.csv", CLASSES) == [first]
    _send(page, "/undo")
    assert json.loads(_ask(page, "/undo", "")[1])["image"] is None


def test_the_next_image_and_the_class_map_are_served(page: HTTPConnection) -> None:
    assert json.loads(_ask(page, "/next?after=a.png")[1])["image"] == "b.jpg"
    status, body = _ask(page, "/preview/a.png")
    assert (status, b"picks of two classes" in body) == (404, True)
    for name, x in (("carpet", 1), ("background", 14)):
        _send(page, "/paint", points=[[x, 4]], **{"class": name})
    status, body = _ask(page, "/preview/a.png")
    assert (status, _decoded(body).shape) == (200, (324, 576, 3))


def test_a_bad_request_is_refused_and_nothing_is_written(
    page: HTTPConnection, folder: Path, tmp_path: Path
) -> None:
    deep, large = ("/pick", "[" * 2000 + "]" * 2000, "nested "), ("/pick", "x" * 70_000, "65536")
    for path, changes, message in (*cases("perception")["bad_requests"], deep, large):
        body = changes if isinstance(changes, str) else json.dumps({**CLICK, **changes})
        status, answer = _ask(page, path, body)
        assert (status, message in answer.decode()) == (400, True), (changes, answer)
    (folder / "b.jpg").write_bytes(b"no image")
    status, answer = _ask(page, "/pick", json.dumps({**CLICK, "image": "b.jpg"}))
    assert (status, b"is not a readable image" in answer) == (400, True)
    assert not (tmp_path / "picks.csv").exists()


def test_what_is_not_there_or_not_listed_is_not_found(page: HTTPConnection) -> None:
    for path in ("/nothing", "/state/a", "/segments/", "/preview/x.png"):
        assert _ask(page, path)[0] == 404
    for name in ("../secret.png", "..%2Fsecret.png", "notes.txt", "c.png"):
        status, answer = _ask(page, f"/picture/{name}")
        assert (status, b"no image" in answer) == (404, True)
    assert _ask(page, "/draw", "{}")[0] == 404


def test_what_another_page_sends_is_refused(page: HTTPConnection, tmp_path: Path) -> None:
    click = json.dumps(CLICK)
    for origin in ("https://evil.example", "null", "http://127.0.0.1:1"):
        assert _ask(page, "/pick", click, Origin=origin)[0] == 403
    # Another site may take a name for this machine.
    assert _ask(page, "/state", Host="evil.example")[0] == 403
    assert _ask(page, "/pick", click, Host="evil.example:80")[0] == 403
    assert not (tmp_path / "picks.csv").exists()
    assert _ask(page, "/pick", click, Origin=f"http://127.0.0.1:{page.port}")[0] == 200


def test_connections_that_say_nothing_keep_nobody_out(page: HTTPConnection) -> None:
    idle = [socket.create_connection(("127.0.0.1", page.port)) for _ in range(5)]
    idle[0].sendall(b"POST /pick HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n{")
    assert _ask(page, "/state")[0] == 200
    for connection in idle:
        connection.close()


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_script_of_the_page_can_be_parsed(page: HTTPConnection, tmp_path: Path) -> None:
    script = _ask(page, "/")[1].partition(b"<script>")[2].partition(b"</script>")[0]
    (tmp_path / "page.js").write_bytes(script)
    node = [str(shutil.which("node")), "--check", str(tmp_path / "page.js")]
    done = subprocess.run(node, capture_output=True, text=True, check=False)  # noqa: S603  # our own
    assert done.returncode == 0, done.stderr
