"""Photographs: stored frames and the files beside them, and reasons for none."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from behaviours.fly.steadiness import Steadiness
from behaviours.fly.take_photo import TakePhoto
from tests.paper_lab import CARPET
from tests.worlds.leaves import map_with
from uav_bt.board import ELAPSED, FRAME, SITE_MAP, STATE
from uav_bt.board.context import FlightFolder
from uav_bt.errors import InputError
from uav_bt.record.images import decode_bytes, decode_image
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live, show
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    NearObstacles,
    Pose2D,
)
from uav_bt.types.flight_results import EventKind


class _Blind:
    """Perception of a drone without images; the leaf only asks whether there is one."""


def photo_bench(out: Path | None, *, sight: bool = False, **attributes: object) -> LeafBench:
    """Return a bench whose flight has an output folder, or none."""
    bench = LeafBench(TakePhoto, **attributes)
    bench.provide(
        outputs=None if out is None else FlightFolder(out),
        sight=_Blind() if sight else None,  # nothing calls it
    )
    return bench


def run(bench: LeafBench, ticks: int, **world: Any) -> list[Status]:
    """Tick until the leaf has ended, at most a number of times."""
    answers: list[Status] = []
    while len(answers) < ticks and (not answers or answers[-1] is Status.RUNNING):
        answers.append(live(bench, **world))
    return answers


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_a_steady_drone_stores_frame_class_map_and_pose(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, label="box 1, left")
    bench.board[ELAPSED] = 20.0
    for _ in range(5):
        assert live(bench) is Status.RUNNING
        assert bench.proposed == Hover()
        assert bench.pointed is None
    show(bench)
    bench.board[SITE_MAP] = replace(
        map_with(NearObstacles()),
        pose=Pose2D(x_m=1.0, y_m=-2.0, yaw_rad=-math.pi / 2),
        captured_s=bench.clock.now(),
    )
    assert bench.tick() is Status.SUCCESS
    name = "photo-001-box-1-left"
    assert names(tmp_path) == [f"{name}-classes.png", f"{name}.jpg", f"{name}.json"]
    image = decode_image((tmp_path / f"{name}.jpg").read_bytes())
    assert image.shape == bench.board[FRAME].image.shape
    assert np.all(decode_bytes((tmp_path / f"{name}-classes.png").read_bytes()) == CARPET)
    facts = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    assert facts == {
        "frame": "start",
        "label": "box 1, left",
        "file": f"{name}.jpg",
        "class_map": f"{name}-classes.png",
        "time_s": 20.0,
        "pose": {"x_m": 1.0, "y_m": -2.0, "heading_deg": 270.0},
        "height_m": 1.5,
        "gimbal_pitch_deg": -30.0,
        "camera_file": None,
        "camera_media": None,
    }
    notes = bench.notes
    assert [photo.label for photo in notes.photos] == ["box 1, left"]
    assert [(event.kind, event.text) for event in notes.events] == [(EventKind.PHOTO, name)]


def test_a_label_is_filled_in(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, label="side {side} of {object}, {nothing}")
    bench.variables["side"], bench.variables["object"] = 2, "object:3"
    assert run(bench, 20)[-1] is Status.SUCCESS
    (photo,) = bench.notes.photos
    assert photo.label == "side 2 of object:3, unknown"
    assert photo.file == "photo-001-side-2-of-object-3-unknown.jpg"


def test_while_the_drone_moves_or_turns_nothing_is_stored(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, timeout_s=1.0)
    answers = run(bench, 20, velocity=BodyVelocity(forward_mps=0.5), flying=FlyingState.FLYING)
    assert answers[-1] is Status.FAILURE
    assert bench.feedback == "no image within 1 s: the drone is not steady"
    assert names(tmp_path) == []

    bench = photo_bench(tmp_path, timeout_s=1.0)
    yaw_rad = 0.0
    for _ in range(20):
        yaw_rad += 0.1 * math.radians(20)
        status = live(bench, yaw_rad=yaw_rad)
        if status is not Status.RUNNING:
            break
    assert status is Status.FAILURE
    event = bench.notes.events[-1]
    assert event.kind is EventKind.NO_PHOTO
    assert event.text == "no image within 1 s: the drone is not steady"


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
    answers = run(bench, 60, gimbal_deg=-80.0)
    assert answers[-1] is Status.SUCCESS
    assert 18 <= len(answers) <= 25


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
    event = bench.notes.events[-1]
    assert event.text == "'door': the flight has no output folder: fly with --out DIR"


def test_a_full_disk_is_a_failure_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full_disk(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    bench = photo_bench(tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full_disk)
        assert run(bench, 20)[-1] is Status.FAILURE
    assert "cannot be written: No space left on device" in bench.feedback
    assert bench.notes.photos == []
    assert run(bench, 20)[-1] is Status.SUCCESS
    assert "photo-002.jpg" in names(tmp_path)


def test_a_drone_without_images_stores_pose_and_class_map(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, sight=True)
    assert run(bench, 20)[-1] is Status.SUCCESS
    assert names(tmp_path) == ["photo-001-classes.png", "photo-001.json"]
    assert bench.notes.photos[0].file is None


def test_a_drone_without_images_and_class_maps_fails_with_one_reason(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path, sight=True, timeout_s="1.0")
    while (status := bench_without_classes(bench)) is Status.RUNNING:
        pass
    assert status is Status.FAILURE
    assert bench.feedback == (
        "no image within 1 s: the drone has no images, and no leaf makes a class map: add Segment"
    )


def bench_without_classes(bench: LeafBench) -> Status:
    bench.clock.advance(0.1)
    bench.hover(gimbal_pitch_rad=math.radians(-30))
    return bench.tick()


def test_without_a_class_map_the_image_is_stored_alone(tmp_path: Path) -> None:
    bench = photo_bench(tmp_path)
    while (status := bench_without_classes(bench)) is Status.RUNNING:
        pass
    assert status is Status.SUCCESS
    assert names(tmp_path) == ["photo-001.jpg", "photo-001.json"]
    facts = json.loads((tmp_path / "photo-001.json").read_text(encoding="utf-8"))
    assert facts["class_map"] is None
    assert facts["pose"] is None


@pytest.mark.parametrize("pitch", ["up", "-91", "nan", ""])
def test_a_pitch_that_is_none_is_refused(pitch: str) -> None:
    with pytest.raises(InputError, match="expected 'keep' or -90 to 90 degrees"):
        TakePhoto(None, pitch_deg=pitch)


def test_a_drone_is_steady_by_its_mean_over_half_a_second() -> None:
    """One noisy sample neither makes it steady nor unsteady."""
    steady, times = Steadiness(), [0.2 * index for index in range(12)]
    for index, time_s in enumerate(times):
        speed = 0.3 if index % 2 else -0.3
        velocity = BodyVelocity(forward_mps=speed)
        steady.update(
            DroneState(captured_s=time_s, flying=FlyingState.HOVERING, velocity=velocity), None
        )
    assert steady.since_s == pytest.approx(0.6)
    for time_s in (2.4, 2.6, 2.8):
        velocity = BodyVelocity(forward_mps=0.5)
        steady.update(
            DroneState(captured_s=time_s, flying=FlyingState.FLYING, velocity=velocity), None
        )
    assert steady.since_s == math.inf
