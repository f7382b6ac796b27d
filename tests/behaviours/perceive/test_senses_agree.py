"""SensesAgree: a contradiction must last, and a missing measurement contradicts nothing."""

import math
from dataclasses import replace

import numpy as np

from behaviours.perceive.senses_agree import SensesAgree
from perception.camera.ground_plane import CameraView, ground_depth
from tests.paper_lab import CARPET
from tests.worlds.values import motion
from uav_bt.board import ODOMETRY, RELATIVE_DEPTH
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import show
from uav_bt.tree import Status
from uav_bt.types import DepthMap
from uav_bt.types.dead_reckoning import OdometryPose

CAMERA = pinhole(640, 360)


def see(
    bench: LeafBench, seconds: float, *, focal: float = 1.0, depth: bool = True
) -> list[Status]:
    """Show frames for a time, with the camera of the file wrong by a factor."""
    bench.camera = replace(CAMERA, fx_px=focal * CAMERA.fx_px, fy_px=focal * CAMERA.fy_px)
    view = CameraView(camera=CAMERA.resized(224, 112), pitch_rad=math.radians(-32.0), height_m=1.5)
    heights = np.nan_to_num(ground_depth(view), nan=50.0) / np.float32(1.5)
    answers = []
    for _ in range(round(seconds / 0.1)):
        show(bench, ids=np.full((112, 224), CARPET, np.uint8), gimbal_deg=-32.0)
        if depth:
            now_s = bench.clock.now()
            bench.board[RELATIVE_DEPTH] = DepthMap(
                depth=heights, metric=False, captured_s=now_s, in_heights=True
            )
        answers.append(bench.tick())
    return answers


def move(
    bench: LeafBench,
    seconds: float,
    stretch: float | None = None,
    *,
    ground_share: float | None = None,
    follows: int = 1,
) -> list[Status]:
    """Tick with answers of the odometry, without frames; one frame in `follows` is followed."""
    answers = []
    for tick in range(round(seconds / 0.1)):
        bench.clock.advance(0.1)
        pose = OdometryPose(x_m=0.0, y_m=0.0, yaw_rad=0.0, time_s=bench.clock.now())
        bench.board[ODOMETRY] = motion(
            pose,
            tracked_s=pose.time_s if tick % follows == 0 else 0.0,
            stretch=stretch,
            ground_share=ground_share,
        )
        answers.append(bench.tick())
    return answers


def bench(**ports: float) -> LeafBench:
    return LeafBench(SensesAgree, for_s=2.0, **ports)


def test_a_wrong_camera_file_fails_after_the_window_and_says_why_until_it_is_right() -> None:
    wrong = bench()
    answers = see(wrong, 3.0, focal=2.0)
    assert answers[:19] == [Status.SUCCESS] * 19
    assert answers[22:] == [Status.FAILURE] * len(answers[22:])
    assert "is the camera file that of this drone" in wrong.feedback
    assert see(wrong, 2.5)[-1] is Status.SUCCESS


def test_a_short_contradiction_passes() -> None:
    short = bench()
    for seconds, focal in ((3.0, 1.0), (0.8, 2.0), (1.0, 1.0)):
        assert set(see(short, seconds, focal=focal)) == {Status.SUCCESS}
    assert set(see(bench(), 5.0, focal=2.0, depth=False)) == {Status.SUCCESS}


def test_a_wrong_motion_over_the_ground_fails_after_the_window() -> None:
    for motions, message in (
        ({"stretch": 0.7}, "the ground passes 0.70 times as fast as telemetry reports"),
        ({"stretch": 1.5}, "the ground passes 1.50 times as fast as telemetry reports"),
        ({"stretch": -0.2}, "the ground passes -0.20 times as fast as telemetry reports"),
        (
            {"ground_share": 0.5, "follows": 5},
            "the floor shows too little texture: its motion was measured in 19% of the frames",
        ),
    ):
        wrong = bench()
        answers = move(wrong, 3.0, **motions)
        assert answers[:20] == [Status.SUCCESS] * 20
        assert answers[21:] == [Status.FAILURE] * 9
        assert message in wrong.feedback


def test_the_motion_agrees_again_and_the_time_of_a_pause_does_not_count() -> None:
    for motions in ({"stretch": 1.5}, {"ground_share": 0.5, "follows": 100}):
        wrong, paused = bench(), bench()
        assert move(wrong, 3.0, **motions)[-1] is Status.FAILURE
        assert move(wrong, 2.5, ground_share=0.5)[-1] is Status.SUCCESS
        move(paused, 1.5, **motions)
        paused.clock.advance(60.0)
        assert set(move(paused, 1.5, **motions)) == {Status.SUCCESS}


def test_small_and_unknown_contradictions_are_none() -> None:
    for ports, motions in (
        ({}, {"stretch": None}),
        ({}, {"stretch": 0.9}),
        ({}, {"stretch": 1.2}),
        ({}, {"ground_share": 0.5, "follows": 2}),  # followed now and then
        ({}, {"ground_share": 0.1, "follows": 100}),  # little ground in view
        ({}, {"ground_share": None, "follows": 100}),
        ({"followed": 0.0}, {"ground_share": 0.5, "follows": 100}),  # no check
        ({"stretch": 10.0}, {"stretch": 1.5}),
    ):
        assert set(move(bench(**ports), 4.0, **motions)) == {Status.SUCCESS}
