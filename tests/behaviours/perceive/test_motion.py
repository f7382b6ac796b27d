"""TrackMotion: the drone's pose and velocity over the ground, in every tick."""

import math
from typing import Any

import pytest

from behaviours.perceive.site_map import TrackMotion
from tests.worlds.leaves import replace_tree
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, ODOMETRY, STATE
from uav_bt.board.blackboard import Key
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, DroneState, FlyingState


def tracking() -> LeafBench:
    bench = LeafBench(TrackMotion)
    bench.camera = pinhole(640, 360)
    return bench


def test_the_motion_is_written_every_tick_from_the_first_class_map_on() -> None:
    """Between two frames, too; by telemetry alone until ground is followed, never without it."""
    bench = tracking()
    show(bench)
    del bench.board[STATE]
    assert bench.tick() is Status.SUCCESS
    assert ODOMETRY not in bench.board
    live(bench)
    first = bench.board[ODOMETRY]
    assert first.seen == first.pose
    bench.clock.advance(0.1)
    bench.observe(DroneState(captured_s=bench.clock.now(), flying=FlyingState.FLYING))
    bench.tick()
    then = bench.board[ODOMETRY]
    assert then.pose.time_s == bench.clock.now()
    assert then.seen == first.seen
    assert (then.error, then.tracked_s) == (BodyVelocity(), -math.inf)


@pytest.mark.parametrize("missing", [FRAME, CLASS_MAP, CAMERA])
def test_without_a_view_telemetry_is_integrated(missing: Key[Any]) -> None:
    """0.5 m/s for 0.1 s, from standing still: 2.5 cm."""
    bench = tracking()
    live(bench)
    show(bench, velocity=BodyVelocity(forward_mps=0.5))
    del bench.board[missing]
    assert bench.tick() is Status.SUCCESS
    assert bench.board[ODOMETRY].pose.x_m == pytest.approx(0.025)


def test_the_frame_of_the_poses_is_kept_when_another_tree_takes_over() -> None:
    bench = tracking()
    live(bench)
    live(bench, velocity=BodyVelocity(forward_mps=0.5))
    flown_m = bench.board[ODOMETRY].pose.x_m
    replace_tree(bench, TrackMotion())
    live(bench, velocity=BodyVelocity(forward_mps=0.5))
    assert bench.board[ODOMETRY].pose.x_m == pytest.approx(flown_m + 0.05)
