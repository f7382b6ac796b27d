"""SwayAround: once around, from side to side."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.sway_around import SwayAround
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import GimbalTo, Velocity


def _flown(bench: LeafBench, seconds: float) -> list[Velocity]:
    flown = []
    for _ in range(round(seconds / 0.1)):
        if live(bench, seconds=0.1) is not Status.RUNNING:
            break
        assert isinstance(bench.proposed, Velocity)
        flown.append(bench.proposed)
    return flown


def test_it_turns_and_moves_to_both_sides() -> None:
    bench = LeafBench(SwayAround, seconds=8.0, sway_m=0.2, period_s=2.0)
    flown = _flown(bench, 2.0)
    assert max(each.right_mps for each in flown) > 0.3
    assert min(each.right_mps for each in flown) < -0.3
    assert all(each.yaw_rate_radps > 0.0 for each in flown)


def test_it_ends_after_its_time() -> None:
    bench = LeafBench(SwayAround, seconds=8.0)
    assert len(_flown(bench, 7.9)) == pytest.approx(79, abs=1)
    assert Status.SUCCESS in {live(bench, seconds=0.1) for _ in range(3)}


def test_the_camera_looks_at_the_horizon_and_at_the_ground_in_turn() -> None:
    bench = LeafBench(SwayAround, seconds=20.0, period_s=2.0, gimbal_deg=-40.0, level_deg=-5.0)
    pointed = []
    for _ in range(6):
        live(bench, seconds=1.0)
        pointed.append(bench.pointed)
    assert GimbalTo(pitch_rad=math.radians(-5.0)) in pointed
    assert GimbalTo(pitch_rad=math.radians(-40.0)) in pointed
