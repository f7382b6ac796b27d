"""TakePhoto with a drone whose camera takes photographs, too."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from behaviours.fly.take_photo import TakePhoto
from uav_bt.board.context import FlightFolder
from uav_bt.protocols import Still, StillState
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import GimbalTo, Hover
from uav_bt.types.flight_results import EventKind

SAVED = Still(state=StillState.SAVED, media="10000001")
FULL = Still(state=StillState.FAILED, reason="the memory card is full")


class Camera:
    """A camera that ends each photograph when the test lets it."""

    def __init__(self) -> None:
        self.asked = 0
        self.end = Still()

    def take_still(self) -> int:
        self.asked += 1
        return self.asked

    def still(self, number: int) -> Still:
        assert number == self.asked
        return self.end

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        raise AssertionError(f"{media} was fetched in flight, within {limit_s} s")


@pytest.fixture
def camera() -> Camera:
    return Camera()


def photo_bench(out: Path, camera: Camera, **attributes: object) -> LeafBench:
    bench = LeafBench(TakePhoto, label="door", **attributes)
    bench.provide(outputs=FlightFolder(out), stills=camera)
    return bench


def until_asked(bench: LeafBench, camera: Camera) -> None:
    """Tick until the camera is asked for a photograph."""
    for _ in range(20):
        assert live(bench) is Status.RUNNING
        if camera.asked:
            return
    raise AssertionError("the camera was not asked")


def test_frame_and_photograph_are_of_one_moment(tmp_path: Path, camera: Camera) -> None:
    bench = photo_bench(tmp_path, camera)
    until_asked(bench, camera)
    at_s = bench.clock.now()
    for _ in range(5):
        assert live(bench) is Status.RUNNING
        assert bench.proposed == Hover()
    assert list(tmp_path.iterdir()) == []
    camera.end = SAVED
    assert live(bench) is Status.SUCCESS
    (photo,) = bench.notes.photos
    assert (photo.camera_file, photo.camera_media) == ("photo-001-door-camera.jpg", "10000001")
    facts = json.loads((tmp_path / "photo-001-door.json").read_text())
    assert facts["camera_file"] == photo.camera_file
    assert photo.time_s <= at_s
    assert camera.asked == 1


def test_a_full_card_is_a_failure_and_the_frame_is_stored(tmp_path: Path, camera: Camera) -> None:
    bench = photo_bench(tmp_path, camera)
    until_asked(bench, camera)
    camera.end = FULL
    assert live(bench) is Status.FAILURE
    assert bench.feedback == "the drone's camera took no photograph: the memory card is full"
    kinds = [(event.kind, event.text) for event in bench.notes.events]
    assert kinds == [
        (EventKind.PHOTO, "photo-001-door"),
        (EventKind.NO_PHOTO, f"'door': {bench.feedback}"),
    ]
    assert (tmp_path / "photo-001-door.jpg").is_file()
    assert bench.notes.photos[0].camera_file is None


def test_a_camera_that_does_not_answer_is_given_up(tmp_path: Path, camera: Camera) -> None:
    bench = photo_bench(tmp_path, camera, timeout_s=1.0)
    until_asked(bench, camera)
    answers = [live(bench) for _ in range(10)]
    assert answers == [*[Status.RUNNING] * 9, Status.FAILURE]
    assert bench.feedback.endswith("the camera has not confirmed it within 1 s")


def test_the_camera_may_be_left_out(tmp_path: Path, camera: Camera) -> None:
    bench = photo_bench(tmp_path, camera, camera_photo="false")
    answers = [live(bench) for _ in range(6)]
    assert answers[-1] is Status.SUCCESS
    assert camera.asked == 0


def test_the_camera_is_restored_after_its_photograph(tmp_path: Path, camera: Camera) -> None:
    bench = photo_bench(tmp_path, camera, pitch_deg="-40")
    for _ in range(30):
        gimbal_deg = -30.0 if bench.pointed is None else -40.0
        assert live(bench, gimbal_deg=gimbal_deg) is Status.RUNNING
        if camera.asked:
            break
    assert camera.asked == 1
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-40))
    camera.end = SAVED
    assert live(bench, gimbal_deg=-40.0) is Status.RUNNING
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-30))
    assert live(bench, gimbal_deg=-30.0) is Status.SUCCESS
