"""Photographs: stored frames and the files beside them, the drone's own, and reasons for none."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from behaviours.fly.take_photo import Steadiness, TakePhoto
from tests.paper_lab import CARPET
from tests.worlds import footage
from tests.worlds.leaves import map_with
from tests.worlds.processes import full_disk
from uav_bt.board import ELAPSED, FLIGHT_HEIGHT, FRAME, SITE_MAP, STATE
from uav_bt.board.context import FlightFolder
from uav_bt.errors import InputError
from uav_bt.protocols import Still, StillState
from uav_bt.record.images import decode_bytes, decode_image
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, GimbalTo, Hover, NearObstacles, Pose2D
from uav_bt.types.flight_results import EventKind

BLIND = object()  # perception of a drone without images; the leaf only asks whether there is one


class Camera:
    """A camera that ends each photograph when the test lets it, and fetches none in flight."""

    def __init__(self) -> None:
        self.asked = 0
        self.end = Still()

    def take_still(self) -> int:
        self.asked += 1
        return self.asked

    def still(self, number: int) -> Still:
        assert number == self.asked
        return self.end


def photo_bench(out: Path | None, **attributes: object) -> LeafBench:
    """Return a bench whose flight has an output folder, or none; `sight` and `stills` are parts."""
    parts = {name: attributes.pop(name, None) for name in ("sight", "stills")}
    bench = LeafBench(TakePhoto, **attributes)
    bench.provide(outputs=None if out is None else FlightFolder(out), **parts)
    return bench


def run(bench: LeafBench, ticks: int, **world: Any) -> list[Status]:
    """Tick until the leaf has ended, at most a number of times."""
    found: list[Status] = []
    while len(found) < ticks and (not found or found[-1] is Status.RUNNING):
        found.append(live(bench, **world))
    return found


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_a_steady_drone_stores_frame_class_map_and_pose(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, label="box {n},-2 {nothing}")
    bench.variables["n"] = 1
    bench.board[ELAPSED] = 20.0
    for _ in range(5):
        assert live(bench) is Status.RUNNING
        assert (bench.proposed, bench.pointed) == (Hover(), None)
    show(bench)
    bench.board[SITE_MAP] = replace(
        map_with(NearObstacles()),
        pose=Pose2D(x_m=1.0, y_m=-2.0, yaw_rad=-math.pi / 2),
        captured_s=bench.clock.now(),
        moved_s=bench.clock.now(),
    )
    bench.board[FLIGHT_HEIGHT] = 1.1
    assert bench.tick() is Status.SUCCESS
    name = "photo-001-box-1--2-unknown"
    assert names(tmp_path) == [f"{name}-classes.png", f"{name}.jpg", f"{name}.json"]
    image = decode_image((tmp_path / f"{name}.jpg").read_bytes())
    assert image.shape == bench.board[FRAME].image.shape
    assert np.all(decode_bytes((tmp_path / f"{name}-classes.png").read_bytes()) == CARPET)
    facts = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert facts == {
        "frame": "start",
        "label": "box 1,-2 unknown",
        "file": f"{name}.jpg",
        "class_map": f"{name}-classes.png",
        "time_s": 20.0,
        "pose": {"x_m": 1.0, "y_m": -2.0, "heading_deg": 270.0},
        "height_m": 1.5,
        "raised_m": 0.4,  # for a mover
        "gimbal_pitch_deg": -30.0,
        "camera_file": None,
        "camera_media": None,
    }
    assert [photo.label for photo in bench.notes.photos] == ["box 1,-2 unknown"]
    assert [(event.kind, event.text) for event in bench.notes.events] == [(EventKind.PHOTO, name)]


def test_while_the_drone_moves_or_turns_nothing_is_stored(tmp_path: Path) -> None:
    for forward_mps, turn_deg in ((0.5, 0.0), (0.0, 2.0)):
        bench = photo_bench(tmp_path, timeout_s=1.0)
        status, ticks = Status.RUNNING, 0
        while status is Status.RUNNING and ticks < 20:
            ticks += 1
            velocity = BodyVelocity(forward_mps=forward_mps)
            status = live(bench, velocity=velocity, yaw_rad=math.radians(ticks * turn_deg))
        assert status is Status.FAILURE
        assert bench.feedback == "no image within 1 s: the drone is not steady"
        (event,) = bench.notes.events
        assert (event.kind, event.text) == (EventKind.NO_PHOTO, bench.feedback)
    assert names(tmp_path) == []


def test_the_camera_is_pointed_and_restored(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, pitch_deg="-80")
    run(bench, 10)
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-80))
    assert names(tmp_path) == []
    assert bench.feedback == "the camera is at -30 degrees"
    assert live(bench, gimbal_deg=-80.0) is Status.RUNNING
    assert len(names(tmp_path)) == 3
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-30))
    assert live(bench, gimbal_deg=-60.0) is Status.RUNNING
    assert live(bench, gimbal_deg=-30.0) is Status.SUCCESS
    assert bench.pointed is None


def test_a_camera_that_does_not_come_back_delays_the_answer_only(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, pitch_deg="-80")
    run(bench, 10)
    found = run(bench, 60, gimbal_deg=-80.0)
    assert found[-1] is Status.SUCCESS
    assert 18 <= len(found) <= 25


def test_a_failed_photograph_restores_the_camera(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, pitch_deg="-80", timeout_s="0.5")
    for _ in range(4):
        live(bench)
    velocity = BodyVelocity(right_mps=1.0)
    while bench.pointed != GimbalTo(pitch_rad=math.radians(-30)):
        assert live(bench, gimbal_deg=-80.0, velocity=velocity) is Status.RUNNING
    assert live(bench, gimbal_deg=-30.0, velocity=velocity) is Status.FAILURE


def test_stale_frames_and_a_pilot_do_not_count(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, timeout_s="2.0")
    bench.allow_stale()
    moves = BodyVelocity(forward_mps=0.5)
    assert run(bench, 2, velocity=moves)[-1] is Status.RUNNING
    for _ in range(50):  # the video is gone, telemetry is not
        frame = bench.board[FRAME]
        show(bench, velocity=moves)
        bench.board[FRAME] = frame
        assert bench.tick() is Status.RUNNING
    assert live(bench, seconds=30.0, velocity=moves) is Status.RUNNING  # a pilot flew
    del bench.board[STATE]
    assert bench.tick(advance_s=0.1) is Status.RUNNING
    assert run(bench, 10)[-1] is Status.SUCCESS


def test_without_a_folder_it_fails_at_once_and_says_what_to_do(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = photo_bench(None, label="door")
    bench.setup()
    assert "Bench/TakePhoto will fail: the flight has no output folder" in caplog.text
    assert live(bench) is Status.FAILURE
    (event,) = bench.notes.events
    assert event.text == "'door': the flight has no output folder: fly with --out DIR"


def test_a_full_disk_is_a_failure_with_the_reason(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path)
    with full_disk():
        assert run(bench, 20)[-1] is Status.FAILURE
    assert "cannot be written: File too large" in bench.feedback
    assert bench.notes.photos == []
    assert run(bench, 20)[-1] is Status.SUCCESS
    assert "photo-002.jpg" in names(tmp_path)


def test_a_drone_without_images_stores_pose_and_class_map(tmp_path: Path) -> None:
    """The drone's camera may be left out."""
    camera = Camera()
    bench = photo_bench(tmp_path, sight=BLIND, stills=camera, camera_photo="false")
    assert run(bench, 6)[-1] is Status.SUCCESS
    assert names(tmp_path) == ["photo-001-classes.png", "photo-001.json"]
    assert (bench.notes.photos[0].file, camera.asked) == (None, 0)


@pytest.mark.parametrize("sight", [None, BLIND])
def test_without_class_maps_only_an_image_is_stored(tmp_path: Path, sight: object) -> None:
    bench, status = photo_bench(tmp_path, sight=sight, timeout_s="1.0"), Status.RUNNING
    while status is Status.RUNNING:
        bench.clock.advance(0.1)
        bench.hover(gimbal_pitch_rad=math.radians(-30))
        status = bench.tick()
    if sight is not None:
        why = "the drone has no images, and no leaf makes a class map: add Segment"
        assert (status, bench.feedback) == (Status.FAILURE, f"no image within 1 s: {why}")
        return
    assert names(tmp_path) == ["photo-001.jpg", "photo-001.json"]
    (photo,) = bench.notes.photos
    assert (status, photo.class_map, photo.pose) == (Status.SUCCESS, None, None)


@pytest.mark.parametrize("pitch", ["up", "-91", "nan", ""])
def test_a_pitch_that_is_none_is_refused(pitch: str) -> None:
    with pytest.raises(InputError, match="expected 'keep' or -90 to 90 degrees"):
        TakePhoto(None, pitch_deg=pitch)


def test_a_drone_is_steady_by_its_mean_over_half_a_second() -> None:
    steady, since_s = Steadiness(), []
    speeds_mps = [0.3 if index % 2 else -0.3 for index in range(12)] + [0.5] * 3
    for index, forward_mps in enumerate(speeds_mps):
        steady.update(footage.state(0.2 * index, forward_mps), None)
        since_s.append(steady.since_s)
    assert since_s[11] == pytest.approx(0.6)
    assert since_s[-1] == math.inf


# The drone's own camera.


def asked(out: Path, **attributes: object) -> tuple[LeafBench, Camera]:
    """Return a bench whose leaf has just asked the camera for a photograph."""
    camera = Camera()
    bench = photo_bench(out, stills=camera, label="door", **attributes)
    for _ in range(30):
        gimbal_deg = -30.0 if bench.pointed is None else -40.0
        assert live(bench, gimbal_deg=gimbal_deg) is Status.RUNNING
        if camera.asked:
            return bench, camera
    raise AssertionError("the camera was not asked")


def test_frame_and_photograph_are_of_one_moment(tmp_path: Path) -> None:
    bench, camera = asked(tmp_path, pitch_deg="-40")
    at_s = bench.clock.now()
    for _ in range(5):
        assert live(bench, gimbal_deg=-40.0) is Status.RUNNING
        assert (bench.proposed, bench.pointed) == (Hover(), GimbalTo(pitch_rad=math.radians(-40)))
    assert names(tmp_path) == []
    camera.end = Still(state=StillState.SAVED, media="10000001")
    assert live(bench, gimbal_deg=-40.0) is Status.RUNNING
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-30))
    assert live(bench, gimbal_deg=-30.0) is Status.SUCCESS
    (photo,) = bench.notes.photos
    assert (photo.camera_file, photo.camera_media) == ("photo-001-door-camera.jpg", "10000001")
    facts = json.loads((tmp_path / "photo-001-door.json").read_text())
    assert facts["camera_file"] == photo.camera_file
    assert photo.time_s <= at_s
    assert camera.asked == 1


@pytest.mark.parametrize(
    ("end", "ticks", "reason"),
    [
        (Still(state=StillState.FAILED, reason="the memory card is full"), 1, ""),
        (Still(), 10, "the camera has not confirmed it within 1 s"),
    ],
)
def test_without_a_photograph_it_fails_and_the_frame_is_stored(
    tmp_path: Path, end: Still, ticks: int, reason: str
) -> None:
    bench, camera = asked(tmp_path, timeout_s=1.0)
    camera.end = end
    assert run(bench, 30) == [*[Status.RUNNING] * (ticks - 1), Status.FAILURE]
    assert bench.feedback == f"the drone's camera took no photograph: {end.reason or reason}"
    assert [(event.kind, event.text) for event in bench.notes.events] == [
        (EventKind.PHOTO, "photo-001-door"),
        (EventKind.NO_PHOTO, f"'door': {bench.feedback}"),
    ]
    assert (tmp_path / "photo-001-door.jpg").is_file()
    assert bench.notes.photos[0].camera_file is None
