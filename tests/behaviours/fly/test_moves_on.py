"""MovesOn: how long the drone stays around one place."""

from __future__ import annotations

import math

from behaviours.fly.moves_on import MovesOn
from tests.worlds.values import motion
from uav_bt.board import ODOMETRY
from uav_bt.testing import LeafBench
from uav_bt.tree import Status
from uav_bt.types.dead_reckoning import OdometryPose


def stay(bench: LeafBench, x_m: float, seconds: float) -> Status:
    """Tick for a time at one place, twice a second; return the last answer."""
    status = Status.RUNNING
    for _ in range(round(2 * seconds)):
        bench.clock.advance(0.5)
        pose = OdometryPose(x_m=x_m, y_m=0.0, yaw_rad=0.0, time_s=bench.clock.now())
        bench.board[ODOMETRY] = motion(pose, tracked_s=-math.inf)
        status = bench.tick()
    return status


def test_it_fails_after_a_stay_and_still_does_when_the_tree_tries_again() -> None:
    bench = LeafBench(MovesOn, for_s=10.0)
    assert stay(bench, 0.0, 10.0) is Status.SUCCESS
    assert stay(bench, 0.4, 0.5) is Status.FAILURE
    bench.halt()
    assert stay(bench, 0.4, 0.5) is Status.FAILURE


def test_a_drone_that_gets_away_from_its_place_may_stay_at_the_next() -> None:
    bench = LeafBench(MovesOn, for_s=10.0)
    stay(bench, 0.0, 9.0)
    assert stay(bench, 0.6, 9.5) is Status.SUCCESS
    assert stay(bench, 0.6, 1.0) is Status.FAILURE


def test_the_time_of_a_pause_does_not_count() -> None:
    """A pilot, or another branch that gives way, held the drone."""
    bench = LeafBench(MovesOn, for_s=10.0)
    stay(bench, 0.0, 5.0)
    bench.clock.advance(100.0)
    assert stay(bench, 0.0, 4.0) is Status.SUCCESS
