"""The small leaves: hover for a while, point the camera, turn, know the mark."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.look import HoverFor, Hovering, PointCamera, Turn
from tests.worlds.leaves import wait
from uav_bt.board import PHASE
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    GimbalTo,
    Hover,
    MoveBy,
    MovementState,
    MovementStatus,
)


def test_hovers_for_its_time() -> None:
    """It proposes a hover until the time is over, and nothing in the tick in which it is."""
    bench = LeafBench(HoverFor, seconds="2.0")
    assert live(bench) is Status.RUNNING
    assert bench.proposed == Hover()
    assert bench.board[PHASE] == "hover"
    assert wait(bench, 1.9) is Status.RUNNING

    assert live(bench, seconds=0.2) is Status.SUCCESS
    assert bench.proposed is None


def test_time_in_which_a_person_flies_is_not_hovered() -> None:
    """The tree is not ticked then; the leaf hovers for the remaining time afterwards."""
    bench = LeafBench(HoverFor, seconds=2.0)
    live(bench)
    wait(bench, 1.0)

    assert live(bench, seconds=10.0) is Status.RUNNING
    assert wait(bench, 0.9) is Status.RUNNING
    assert live(bench, seconds=0.2) is Status.SUCCESS


def test_points_until_a_frame_comes_from_there() -> None:
    """The picture counts, not the command."""
    bench = LeafBench(PointCamera, pitch_deg=-60.0)
    assert live(bench, gimbal_deg=-30.0) is Status.RUNNING
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-60))
    assert bench.proposed is None

    assert live(bench, gimbal_deg=-59.0) is Status.SUCCESS
    assert bench.pointed is None


def test_turns_until_the_drone_says_it_ended() -> None:
    """Clockwise positive."""
    bench = LeafBench(Turn, degrees=-90.0)
    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, yaw_rad=-math.pi / 2)
    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, yaw_rad=-math.pi / 2)

    bench.finish_movement()
    assert bench.tick(advance_s=0.1) is Status.SUCCESS
    assert bench.proposed is None


@pytest.mark.parametrize("seconds", [0.1, 10.0])
@pytest.mark.parametrize("word", [MovementState.INTERRUPTED, MovementState.REJECTED])
def test_an_interrupted_turn_goes_on_to_the_same_heading(
    seconds: float, word: MovementState
) -> None:
    """After an override as after a person who turned it back a little."""
    bench = LeafBench(Turn, degrees=200.0)
    for heading_deg in (150, 170, 190, 210):
        live(bench, yaw_rad=math.remainder(math.radians(heading_deg), 2.0 * math.pi))
    over = MovementStatus(id=1, state=word)
    yaw_rad = math.radians(200 - 360)

    assert live(bench, seconds=seconds, yaw_rad=yaw_rad, movement=over) is Status.RUNNING
    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.id == 2
    assert math.degrees(bench.proposed.yaw_rad) == pytest.approx(150)
    done = MovementStatus(id=2, state=MovementState.DONE)
    assert live(bench, yaw_rad=yaw_rad, movement=done) is Status.SUCCESS


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        (BodyVelocity(), Status.SUCCESS),
        (BodyVelocity(forward_mps=0.1, right_mps=-0.1), Status.SUCCESS),
        (BodyVelocity(forward_mps=0.12, right_mps=-0.12), Status.FAILURE),
        (BodyVelocity(forward_mps=-0.3), Status.FAILURE),
        (BodyVelocity(down_mps=0.5), Status.SUCCESS),
    ],
)
def test_hovering_asks_for_the_horizontal_speed(velocity: BodyVelocity, expected: Status) -> None:
    """Whatever its direction."""
    assert live(LeafBench(Hovering, below_mps=0.15), velocity=velocity) is expected
