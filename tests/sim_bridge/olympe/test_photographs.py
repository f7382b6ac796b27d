"""Photographs of an ANAFI's camera: commands and events, and the files from its web server."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

from sim_bridge.olympe import media
from sim_bridge.olympe.media import fetch_photo
from tests.sim_bridge.olympe.fake_olympe import PATIENCE_S, Flight
from uav_bt.errors import DroneError
from uav_bt.protocols import Photographing, Still, StillState

SAVED = Still(state=StillState.SAVED, media="10000001")


class Flown(Flight):
    """A connected drone, and the answers of its camera."""

    def __init__(self, mode: str = "recording") -> None:
        super().__init__()
        assert isinstance(self.drone, Photographing)
        assert self.drone.stills is not None
        self.stills = self.drone.stills
        self.event("camera_mode", mode=mode)
        self.event("photo_state", available="not_available", state="inactive")

    @property
    def asked(self) -> list[str]:
        """Commands to the camera, and the modes that it was set to."""
        return [
            str(args.get("value", name.rpartition(".")[2]))
            for name, args in self.sdk.sent
            if name.startswith("camera.")
        ]

    def event(self, name: str, **args: object) -> None:
        self.sdk.event(f"camera.{name}", **{"cam_id": 0, **args})

    def progress(self, *results: str) -> None:
        for result in results:
            name = SAVED.media if result == "photo_saved" else ""
            self.event("photo_progress", result=result, photo_count=1, media_id=name)

    def ready(self) -> None:
        """Report the mode for photographs, and tick."""
        self.event("camera_mode", mode="photo")
        self.event("photo_state", available="available", state="inactive")
        self.drone.observe()


@pytest.mark.parametrize(
    ("mode", "commands"),
    [("recording", ["photo", "take_photo", "recording"]), ("photo", ["take_photo"])],
)
def test_the_camera_changes_its_mode(mode: str, commands: list[str]) -> None:
    flown = Flown(mode)
    for _ in range(2):
        number = flown.stills.take_still()
        flown.event("camera_mode", mode="photo")
        flown.drone.observe()  # the camera is not ready
        flown.ready()
        flown.progress("taking_photo", "photo_taken")
        assert flown.stills.still(number) == Still()
        flown.progress("photo_saved")
        assert flown.stills.still(number) == SAVED
        flown.drone.observe()
        flown.drone.observe()
        flown.event("camera_mode", mode=mode)
        flown.event("photo_state", available="not_available", state="inactive")
    assert flown.asked == commands * 2


def test_an_error_of_the_camera_is_the_reason() -> None:
    flown = Flown()
    number = flown.stills.take_still()
    flown.ready()
    flown.progress("error_no_storage_space")
    failed = Still(state=StillState.FAILED, reason="the memory card is full")
    assert flown.stills.still(number) == failed
    flown.drone.observe()
    assert flown.asked[-1] == "recording"


@pytest.mark.parametrize(
    ("event", "values", "reason"),
    [
        ("user_storage.state", {"physical_state": "undetected"}, "the drone has no memory card"),
        ("camera.photo_mode", {"mode": "burst"}, "the camera is set to 'burst'"),
        ("camera.photo_mode", {"file_format": "dng"}, "the camera is set to 'dng': choose JPEG"),
    ],
)
def test_what_forbids_photographs(event: str, values: dict[str, str], reason: str) -> None:
    flown = Flown()
    card = {"physical_state": "available", "file_system_state": "ready"}
    usual = {"mode": "single", "file_format": "dng_jpeg", **card}
    flown.sdk.event(event, **usual | values)
    assert flown.stills.still(flown.stills.take_still()).reason.startswith(reason)
    assert flown.asked == []
    flown.sdk.event(event, **usual)
    assert flown.stills.still(flown.stills.take_still()).state is StillState.TAKING


def test_events_of_another_photograph_do_not_count() -> None:
    flown = Flown()
    first = flown.stills.take_still()
    flown.progress("photo_saved", "error")  # before the command
    flown.ready()
    flown.progress("taking_photo")
    second = flown.stills.take_still()
    assert flown.stills.still(first).reason == "another one was asked for"
    flown.progress("photo_saved")  # of the first
    assert flown.stills.still(second) == Still()
    flown.progress("taking_photo", "photo_saved")
    assert flown.stills.still(second) == SAVED


def test_the_mode_is_restored_before_the_drone_is_disconnected() -> None:
    flown = Flown()
    number = flown.stills.take_still()
    flown.ready()
    flown.drone.disconnect()
    assert flown.asked == ["photo", "take_photo", "recording"]
    assert flown.stills.still(number).reason == "the drone was disconnected"
    assert flown.drone.stills is None


def test_a_command_that_fails_ends_the_photograph_and_not_the_flight() -> None:
    flown = Flown()
    flown.world.fails = "send"
    number = flown.stills.take_still()
    flown.drone.observe()
    assert flown.stills.still(number).reason == "the command to the camera failed: no answer"


PHOTO = b"\xff\xd8 a photograph"
LISTED, FILE = "/api/v1/media/medias/100", "/data/media/1000001.JPG"


def medium(url: str = FILE) -> bytes:
    files = [{"format": "DNG", "url": "/data/media/a.DNG"}, {"format": "JPG", "url": url}]
    return json.dumps({"resources": files}).encode()


class Web(BaseHTTPRequestHandler):
    """A web server with fixed answers, or one that sends a byte before every timeout."""

    server: Any

    def do_GET(self) -> None:
        content = self.server.pages.get(self.path)
        self.send_response(404 if content is None else 200)
        self.send_header("Content-Length", str(len(content or b"") + self.server.short))
        self.end_headers()
        while self.server.drips and not self.server.over.wait(0.01):
            self.wfile.write(b".")
        self.wfile.write(content or b"")


@pytest.fixture
def web() -> Iterator[Any]:
    server: Any
    with ThreadingHTTPServer(("127.0.0.1", 0), Web) as server:
        server.pages = {LISTED: medium(), FILE: PHOTO}
        server.short = 0  # bytes that are announced and not sent
        server.drips, server.over = False, threading.Event()
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield server
        server.over.set()
        server.shutdown()


def fetched(server: Any, name: str = "100", limit_s: float = PATIENCE_S) -> bytes:
    host, port = server.server_address
    return fetch_photo(host, port, name, limit_s)


def test_the_jpeg_of_a_photograph_is_fetched_by_its_identifier(web: Any) -> None:
    assert fetched(web) == PHOTO
    with pytest.raises(DroneError, match="which is no identifier"):
        fetched(web, "../x")


@pytest.mark.parametrize(
    ("path", "content", "words"),
    [
        (FILE, None, "answers 404 to GET /data/media/1000001.JPG"),
        (FILE, b"<html>", "something else than a JPEG file"),
        (FILE, PHOTO + b"..", "sends more than 14 bytes"),
        (LISTED, b'{"resources": []}', "lists no JPEG file for '100'"),
        (LISTED, medium("http://127.0.0.9/a.JPG"), "expected a path of it"),
        (LISTED, medium("/data/a.JPG\r\nX: 1"), "expected a path of it"),
    ],
)
def test_what_the_drone_sends_is_checked(
    web: Any, monkeypatch: pytest.MonkeyPatch, path: str, content: bytes | None, words: str
) -> None:
    monkeypatch.setattr(media, "_MAX_PHOTO_BYTES", 14)
    web.pages[path] = content
    with pytest.raises(DroneError, match=words):
        fetched(web)


def test_a_photograph_that_ends_early_or_is_late_is_refused(web: Any) -> None:
    """The time limit holds for all of it, also while bytes arrive."""
    web.short = 1
    with pytest.raises(DroneError, match="does not send it: IncompleteRead"):
        fetched(web)
    web.short, web.drips = 100_000, True
    with pytest.raises(DroneError, match=r"does not send it: it has not come within 0.3 s"):
        fetched(web, limit_s=0.3)
