"""The small leaves: hover for a while, point the camera, turn, know the helipad."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.look import HelipadKnown, HoverFor, Hovering, PointCamera, Turn
from tests.behaviours.leaf_world import halted_proposals, live
from uav_bt.board import FRAME, HELIPAD, PHASE, STATE
from uav_bt.testing import LeafBench
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, GimbalTo, HelipadFix, Hover, MoveBy, MovementState


def test_hovers_for_its_time() -> None:
    """It proposes a hover until the time is over, and nothing in the tick in which it is."""
    bench = LeafBench(HoverFor, seconds="2.0")
    assert live(bench) is Status.RUNNING
    assert bench.proposed == Hover()
    assert bench.board[PHASE] == "hover"
    assert live(bench, seconds=1.9) is Status.RUNNING

    assert live(bench, seconds=0.2) is Status.SUCCESS
    assert bench.proposed is None


def test_halted_the_hover_starts_again() -> None:
    """The time counts from the beginning of an activation."""
    bench = LeafBench(HoverFor, seconds=1.0)
    live(bench)
    assert halted_proposals(bench) == (None, None)

    assert live(bench, seconds=2.0) is Status.RUNNING
    assert live(bench, seconds=1.1) is Status.SUCCESS


def test_points_until_a_frame_comes_from_there() -> None:
    """The picture counts, not the command."""
    bench = LeafBench(PointCamera, pitch_deg=-60.0)
    assert live(bench, gimbal_deg=-30.0) is Status.RUNNING
    assert bench.pointed == GimbalTo(pitch_rad=math.radians(-60))
    assert bench.proposed is None

    assert live(bench, gimbal_deg=-59.0) is Status.SUCCESS
    assert bench.pointed is None


def test_without_a_frame_it_goes_on_pointing() -> None:
    """No picture, no success."""
    bench = LeafBench(PointCamera, pitch_deg=-60.0)
    live(bench)
    del bench.board[FRAME]

    assert bench.tick(advance_s=0.1) is Status.RUNNING
    assert bench.pointed is not None


@pytest.mark.parametrize(
    ("word", "answer"),
    [
        (MovementState.DONE, Status.SUCCESS),
        (MovementState.INTERRUPTED, Status.FAILURE),
        (MovementState.REJECTED, Status.FAILURE),
    ],
)
def test_turns_until_the_drone_says_it_ended(word: MovementState, answer: Status) -> None:
    """Clockwise positive; kept from it is a failure."""
    bench = LeafBench(Turn, degrees=-90.0)
    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, yaw_rad=-math.pi / 2)
    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=1, yaw_rad=-math.pi / 2)

    bench.finish_movement(word)
    assert bench.tick(advance_s=0.1) is answer
    assert bench.proposed is None


def test_a_turn_without_telemetry_stops() -> None:
    """Nothing is proposed until the drone is heard again."""
    bench = LeafBench(Turn, degrees=30.0)
    live(bench)
    del bench.board[STATE]

    assert bench.tick(advance_s=0.1) is Status.RUNNING
    assert bench.proposed is None


def test_a_halted_turn_begins_anew() -> None:
    """With another id: the drone has cancelled the old one."""
    bench = LeafBench(Turn, degrees=30.0)
    live(bench)
    assert halted_proposals(bench) == (None, None)

    live(bench)
    assert bench.proposed == MoveBy(id=2, yaw_rad=math.radians(30))


def _fix(captured_s: float) -> HelipadFix:
    return HelipadFix(captured_s=captured_s, forward_m=1.0, right_m=0.0, detected=False)


def test_knows_the_helipad_while_the_fix_is_young() -> None:
    """Its age counts from the frame in which it was seen."""
    bench = LeafBench(HelipadKnown, max_age_s=1.0)
    assert live(bench) is Status.FAILURE

    bench.board[HELIPAD] = _fix(bench.clock.now())
    assert bench.tick(advance_s=0.9) is Status.SUCCESS
    assert bench.tick(advance_s=0.2) is Status.FAILURE
    assert (bench.proposed, bench.pointed) == (None, None)


def test_a_stale_fix_is_not_known_however_patient_the_port() -> None:
    """The board's own limit comes first."""
    bench = LeafBench(HelipadKnown, max_age_s=1000.0)
    live(bench)
    bench.board[HELIPAD] = _fix(bench.clock.now())
    bench.allow_stale()

    assert bench.tick(advance_s=60.0) is Status.FAILURE


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


def test_a_drone_that_tells_nothing_is_not_taken_to_hover() -> None:
    """Old telemetry says nothing of the present speed."""
    bench = LeafBench(Hovering)
    assert live(bench) is Status.SUCCESS
    bench.allow_stale()
    assert bench.tick(advance_s=10.0) is Status.FAILURE
