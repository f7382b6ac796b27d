"""The page on which a person clicks picks."""

import json
import socket
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.segmentation.training.pick_tool import PickSession, make_pick_server
from perception.segmentation.training.picks import read_picks
from tests.paper_lab import CLASSES
from uav_bt.errors import FileError, ValueRangeError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    photographs = tmp_path / "photographs"
    photographs.mkdir()
    for name in ("a.png", "b.jpg"):
        cv2.imwrite(str(photographs / name), np.zeros((9, 16, 3), np.uint8))
    (photographs / "notes.txt").write_text("not a picture", encoding="utf-8")
    (tmp_path / "secret.png").write_bytes(b"secret")
    return photographs


@pytest.fixture
def page(folder: Path, tmp_path: Path) -> Iterator[HTTPConnection]:
    server = make_pick_server(PickSession(folder, tmp_path / "picks.csv", CLASSES))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    connection = HTTPConnection("127.0.0.1", server.server_port, timeout=10)
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


def test_the_page_and_its_photographs_are_served(page: HTTPConnection, folder: Path) -> None:
    status, body = _ask(page, "/")
    assert status == 200
    assert b"<canvas" in body
    assert _ask(page, "/picture/b.jpg") == (200, (folder / "b.jpg").read_bytes())
    assert json.loads(_ask(page, "/state")[1])["names"] == ["a.png", "b.jpg"]


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
def test_nothing_but_the_listed_photographs_is_served(page: HTTPConnection, name: str) -> None:
    status, body = _ask(page, f"/picture/{name}")
    assert status == 404
    assert b"no photograph" in body


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (_click(image="../secret.png"), b"no photograph"),
        (_click(**{"class": "carpte"}), b"did you mean 'carpet'"),
        (_click(x=-1), b"not be negative"),
        (_click(x=16), b"(16, 4) lies outside of 16x9 pixels"),
        (_click(y=9), b"(3, 9) lies outside of 16x9 pixels"),
        (_click(x=1.5), b"expected a click"),
        (_click(x="3"), b"expected a click"),
        (_click(image=None), b"expected a click"),
        ('{"x": 1e999}', b"beyond a double's range"),
        ("[" * 2000 + "]" * 2000, b"nested "),
        ("\xff", b"no JSON"),
        ("{", b"no JSON"),
        ("[]", b"expected a click"),
        ("x" * 5000, b"at most 4096"),
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


def test_earlier_picks_are_gone_on_with(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "picks.csv"
    PickSession(folder, path, CLASSES).add("a.png", 1, 1, "roof_1")
    session = PickSession(folder, path, CLASSES)
    session.add("b.jpg", 2, 2, "roof_2")
    assert len(read_picks(path, CLASSES)) == 2


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="holds no photographs"):
        PickSession(tmp_path / "empty", tmp_path / "picks.csv", CLASSES)
    with pytest.raises(FileError, match="is not a folder"):
        PickSession(tmp_path / "none", tmp_path / "picks.csv", CLASSES)


def test_undo_without_picks_changes_nothing(folder: Path, tmp_path: Path) -> None:
    PickSession(folder, tmp_path / "picks.csv", CLASSES).undo()
    assert not (tmp_path / "picks.csv").exists()


def test_a_name_not_on_the_list_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError, match=r"no photograph 'secret\.png'"):
        PickSession(folder, tmp_path / "picks.csv", CLASSES).picture("secret.png")
