"""TakeOff: motors, height, camera, in that order; a failure when it takes too long."""

import math

import pytest

from behaviours.fly.take_off import TakeOff
from tests.worlds.leaves import ended, step, wait
from uav_bt.board import FLIGHT_HEIGHT, FLIGHT_PITCH, PHASE
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import FlyingState, GimbalTo
from uav_bt.types import TakeOff as TakeOffCommand

AHEAD = GimbalTo(pitch_rad=math.radians(-30))


def on_the_ground(**attributes: object) -> LeafBench:
    bench = LeafBench(TakeOff, height_m=1.5, gimbal_deg=-30.0, **attributes)
    assert live(bench, flying=FlyingState.LANDED, height_m=0.45) is Status.RUNNING
    return bench


def test_from_the_ground_to_the_flight_height() -> None:
    bench = on_the_ground()
    assert (bench.proposed, bench.pointed) == (TakeOffCommand(), AHEAD)
    assert bench.board[PHASE] == "take-off"
    assert bench.board[FLIGHT_HEIGHT] == 1.5
    assert bench.board[FLIGHT_PITCH] == pytest.approx(math.radians(-30.0))
    live(bench, flying=FlyingState.TAKING_OFF, height_m=0.9)
    assert bench.proposed == TakeOffCommand()
    live(bench, height_m=1.0)
    climb = step(bench)
    assert climb.down_m == pytest.approx(-0.5)
    live(bench, height_m=1.3, flying=FlyingState.FLYING)
    assert bench.proposed == climb
    done = ended(bench)
    assert live(bench, seconds=1.0, height_m=1.52, movement=done) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


def test_it_waits_for_the_camera_and_needs_no_climb_within_a_decimetre() -> None:
    bench = LeafBench(TakeOff, height_m=1.5, gimbal_deg=-30.0)
    assert live(bench, height_m=1.42, gimbal_deg=-10.0) is Status.RUNNING
    assert (bench.proposed, bench.pointed) == (None, AHEAD)
    assert live(bench, height_m=1.42, gimbal_deg=-29.0) is Status.SUCCESS
    assert bench.pointed is None
    bench = LeafBench(TakeOff, height_m=1.0)
    live(bench, height_m=1.4)
    assert step(bench).down_m == pytest.approx(0.4)


def test_too_long_is_a_failure() -> None:
    bench = on_the_ground(give_up_s=5.0)
    assert wait(bench, 4.9, flying=FlyingState.LANDED) is Status.RUNNING
    assert live(bench, seconds=0.2, flying=FlyingState.LANDED) is Status.FAILURE
    assert (bench.proposed, bench.pointed) == (None, None)
    assert "landed" in bench.feedback
