"""The page for picks, and the requests that programs make."""

import json
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
from perception.segmentation.training.picks import read_picks
from tests.paper_lab import CLASSES

USES = {"a.png": "train", "b.jpg": "train", "d.tif": "check"}


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


def _click(**changes: object) -> str:
    return json.dumps({"image": "a.png", "x": 3, "y": 4, "class": "carpet", **changes})


def test_the_page_and_its_images_are_served(page: HTTPConnection, folder: Path) -> None:
    status, body = _ask(page, "/")
    assert status == 200
    assert b"<canvas" in body
    assert _ask(page, "/picture/b.jpg") == (200, (folder / "b.jpg").read_bytes())
    state = json.loads(_ask(page, "/state")[1])
    assert state["names"] == ["a.png", "b.jpg", "d.tif"]
    assert state["uses"] == ["train", "train", "check"]
    assert state["classes"] == list(CLASSES.names)
    assert state["colours"] == CLASSES.colours.tolist()
    assert state["picked_images"] == {"train": 0, "check": 0}


def test_an_image_that_browsers_do_not_show_becomes_png(page: HTTPConnection) -> None:
    status, body = _ask(page, "/picture/d.tif")
    assert status == 200
    assert body.startswith(b"\x89PNG")
    assert (_decoded(body) == 90).all()


def _decoded(png: bytes) -> NDArray[np.uint8]:
    """Return the RGB image of a PNG file's bytes."""
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_segments_number_the_super_pixels(page: HTTPConnection, folder: Path) -> None:
    rgb = np.random.default_rng(0).integers(0, 255, (90, 90, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "a.png"), rgb)
    status, body = _ask(page, "/segments/a.png")
    assert status == 200
    red, green, blue = np.moveaxis(_decoded(body).astype(int), 2, 0)
    ids = red + 256 * green
    assert np.array_equal(ids, find_super_pixels(rgb[..., ::-1].copy()).ids)
    assert ids.max() > 255
    assert not blue.any()


def test_strokes_are_painted_erased_and_undone(page: HTTPConnection, tmp_path: Path) -> None:
    stroke = {"image": "a.png", "points": [[1, 1], [14, 7]]}
    status, body = _ask(page, "/paint", json.dumps({**stroke, "class": "carpet"}))
    state = json.loads(body)
    assert (status, state["image"], state["counts"]["carpet"]) == (200, "a.png", 2)
    assert state["picked_images"] == {"train": 1, "check": 0}
    assert len(read_picks(tmp_path / "picks.csv", CLASSES)) == 2
    _, body = _ask(page, "/erase", json.dumps({**stroke, "points": [[1, 1]]}))
    assert json.loads(body)["counts"]["carpet"] == 1
    _, body = _ask(page, "/undo", "")
    assert (json.loads(body)["image"], json.loads(body)["counts"]["carpet"]) == ("a.png", 2)
    _ask(page, "/undo", "{}")
    assert json.loads(_ask(page, "/undo", "")[1])["image"] is None


def test_the_next_image_and_the_class_map_are_served(page: HTTPConnection) -> None:
    status, body = _ask(page, "/next?after=a.png")
    assert (status, json.loads(body)["image"]) == (200, "b.jpg")
    status, body = _ask(page, "/preview/a.png")
    assert (status, b"picks of two classes" in body) == (404, True)
    for name, x in (("carpet", 1), ("background", 14)):
        _ask(page, "/paint", _stroke([[x, 4]], **{"class": name}))
    status, body = _ask(page, "/preview/a.png")
    assert (status, _decoded(body).shape) == (200, (324, 576, 3))


def _stroke(points: object, **changes: object) -> str:
    return json.dumps({"image": "a.png", "class": "carpet", "points": points, **changes})


@pytest.mark.parametrize(
    ("path", "body", "message"),
    [
        ("/paint", _stroke([]), b"at least one"),
        ("/paint", _stroke([[1, 2, 3]]), b"pairs [x, y]"),
        ("/paint", _stroke([[1, 2.5]]), b"pairs [x, y]"),
        ("/paint", _stroke([[True, 1]]), b"pairs [x, y]"),
        ("/paint", _stroke("1,2"), b"points (list)"),
        ("/paint", _stroke([[1, 2], [16, 2]]), b"(16, 2) lies outside of 16x9 pixels"),
        ("/paint", _stroke([[1, 2]], **{"class": "carpte"}), b"did you mean 'carpet'"),
        ("/erase", _stroke([[1, 2]], image="c.png"), b"no image 'c.png'"),
        ("/erase", _stroke(None), b"points (list)"),
    ],
)
def test_a_bad_stroke_is_refused(
    page: HTTPConnection, tmp_path: Path, path: str, body: str, message: bytes
) -> None:
    status, answer = _ask(page, path, body)
    assert (status, message in answer) == (400, True), answer
    assert not (tmp_path / "picks.csv").exists()


@pytest.mark.parametrize(
    ("path", "body"),
    [("/nothing", None), ("/state/a", None), ("/segments/", None), ("/preview/x.png", None),
     ("/draw", "{}")],
)  # fmt: skip
def test_what_is_not_there_is_not_found(page: HTTPConnection, path: str, body: str | None) -> None:
    assert _ask(page, path, body)[0] == 404


def test_a_click_is_on_disk_and_undo_takes_it_back(page: HTTPConnection, tmp_path: Path) -> None:
    _ask(page, "/pick", _click())
    status, body = _ask(page, "/pick", _click(image="b.jpg"))
    assert status == 200
    assert len(json.loads(body)["picks"]) == 2
    assert [pick.image for pick in read_picks(tmp_path / "picks.csv", CLASSES)] == [
        "a.png",
        "b.jpg",
    ]
    _ask(page, "/undo", "")
    (pick,) = read_picks(tmp_path / "picks.csv", CLASSES)
    assert (pick.image, pick.x, pick.y, pick.class_id, pick.origin) == ("a.png", 3, 4, 1, "hand")


@pytest.mark.parametrize("name", ["../secret.png", "..%2Fsecret.png", "notes.txt", "c.png"])
def test_nothing_but_the_listed_images_is_served(page: HTTPConnection, name: str) -> None:
    status, body = _ask(page, f"/picture/{name}")
    assert status == 404
    assert b"no image" in body


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (_click(image="../secret.png"), b"no image"),
        (_click(**{"class": "carpte"}), b"did you mean 'carpet'"),
        (_click(x=-1), b"(-1, 4) lies outside of 16x9 pixels"),
        (_click(x=16), b"(16, 4) lies outside of 16x9 pixels"),
        (_click(y=9), b"(3, 9) lies outside of 16x9 pixels"),
        (_click(x=1.5), b"expected the fields"),
        (_click(x="3"), b"expected the fields"),
        (_click(image=None), b"expected the fields"),
        ('{"x": 1e999}', b"beyond a double's range"),
        ("[" * 2000 + "]" * 2000, b"nested "),
        ("\xff", b"no JSON"),
        ("{", b"no JSON"),
        ("[]", b"expected the fields"),
        ("x" * 70_000, b"at most 65536"),
    ],
)
def test_a_bad_click_is_refused_and_nothing_is_written(
    page: HTTPConnection, tmp_path: Path, body: str, message: bytes
) -> None:
    status, answer = _ask(page, "/pick", body)
    assert status == 400
    assert message in answer
    assert not (tmp_path / "picks.csv").exists()


def test_another_sites_name_for_this_machine_is_refused(page: HTTPConnection) -> None:
    assert _ask(page, "/state", Host="evil.example")[0] == 403
    assert _ask(page, "/pick", _click(), Host="evil.example:80")[0] == 403


@pytest.mark.parametrize("origin", ["https://evil.example", "null", "http://127.0.0.1:1"])
def test_what_another_page_sends_is_refused(
    page: HTTPConnection, tmp_path: Path, origin: str
) -> None:
    assert _ask(page, "/pick", _click(), Origin=origin)[0] == 403
    assert not (tmp_path / "picks.csv").exists()
    assert _ask(page, "/pick", _click(), Origin=f"http://127.0.0.1:{page.port}")[0] == 200


def test_connections_that_say_nothing_keep_nobody_out(page: HTTPConnection) -> None:
    idle = [socket.create_connection(("127.0.0.1", page.port)) for _ in range(5)]
    idle[0].sendall(b"POST /pick HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n{")
    assert _ask(page, "/state")[0] == 200
    for connection in idle:
        connection.close()


def test_an_image_that_cannot_be_read_takes_no_click(page: HTTPConnection, folder: Path) -> None:
    (folder / "a.png").write_bytes(b"no image")
    status, answer = _ask(page, "/pick", _click())
    assert (status, b"is not a readable image" in answer) == (400, True)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_script_of_the_page_can_be_parsed(page: HTTPConnection, tmp_path: Path) -> None:
    script = _ask(page, "/")[1].partition(b"<script>")[2].partition(b"</script>")[0]
    (tmp_path / "page.js").write_bytes(script)
    done = subprocess.run(  # noqa: S603  # our own script
        [str(shutil.which("node")), "--check", str(tmp_path / "page.js")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
