"""Land, LandHere and EmergencyLand: where to, how, until the motors are off."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.fly.land import EmergencyLand, Land, LandHere
from tests.paper_lab import BACKGROUND, BOXES, CARPET
from tests.worlds import values
from tests.worlds.leaves import ended, step
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, PHASE, STATE
from uav_bt.board.blackboard import Key
from uav_bt.testing import LeafBench
from uav_bt.testing.world import ground, live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, FlyingState, GimbalTo, MoveBy, MovementState, MovementStatus
from uav_bt.types import Land as LandCommand

DOWN = GimbalTo(pitch_rad=-math.pi / 2)


def landing(forward_offset_m: float = 0.15) -> LeafBench:
    bench = LeafBench(Land)
    bench.camera = replace(bench.camera, forward_offset_m=forward_offset_m)
    return bench


def test_steps_forward_then_lands() -> None:
    """The camera hangs over the pad's centre, the body behind it: forward, then down."""
    bench = landing()
    for _ in range(2):
        assert live(bench) is Status.RUNNING
        assert bench.proposed == MoveBy(id=1, forward_m=0.15)
    assert bench.board[PHASE] == "land"
    assert live(bench, movement=ended(bench)) is Status.RUNNING
    assert bench.proposed == LandCommand()
    assert live(bench, flying=FlyingState.LANDING, height_m=0.6) is Status.RUNNING
    assert bench.proposed == LandCommand()
    assert live(bench, flying=FlyingState.LANDED, height_m=0.0) is Status.SUCCESS
    assert bench.proposed is None


def test_without_telemetry_a_landing_that_has_begun_goes_on_and_a_step_waits_for_it() -> None:
    """For some time; then it lands where it is."""
    for lens_m, first in ((0.0, LandCommand()), (0.15, None)):
        bench = landing(lens_m)
        bench.allow_stale()
        live(bench)
        for seconds, proposed in ((0.8, first), (1.5, LandCommand())):
            assert bench.tick(advance_s=seconds) is Status.RUNNING
            assert bench.proposed == proposed


def test_without_a_frame_for_long_the_step_is_left_out_and_later_frames_change_nothing() -> None:
    bench, proposed = landing(), []
    live(bench)
    bench.allow_stale()
    for _ in range(25):
        bench.clock.advance(0.1)
        bench.board[STATE] = replace(bench.board[STATE], captured_s=bench.clock.now())
        bench.tick()
        proposed.append(bench.proposed)
    assert proposed[:19] == [MoveBy(id=1, forward_m=0.15)] * 19
    assert proposed[-1] == LandCommand()
    for flying in (FlyingState.HOVERING, FlyingState.LANDING):
        live(bench, flying=flying)
        assert bench.proposed == LandCommand()


def test_an_emergency_landing_does_not_wait_for_telemetry_and_is_not_taken_back() -> None:
    bench = LeafBench(EmergencyLand)
    bench.allow_stale()
    live(bench)
    for _ in range(8):
        bench.tick(advance_s=0.3)
    assert bench.proposed == LandCommand()
    live(bench, flying=FlyingState.LANDING)
    assert bench.proposed == LandCommand()


def test_the_step_is_as_long_as_the_camera_is_ahead_or_leads_to_the_mark() -> None:
    for lens_m, mark_m, step_m in (
        (0.07, None, (0.07, 0.0)),  # a calibrated camera says where its lens sits
        (0.15, (0.12, -0.04), (0.12, -0.04)),  # the fix corrects the step
        (0.15, (0.9, 0.5), (0.15, 0.0)),  # the mission lands elsewhere on purpose,
    ):
        bench = landing(lens_m)
        if mark_m is not None:
            bench.board[MARK] = values.fix(bench.clock.now(), *mark_m, height_m=0.0)
        live(bench)
        assert bench.proposed == MoveBy(id=1, forward_m=step_m[0], right_m=step_m[1])


def test_an_interrupted_step_goes_on_with_the_rest() -> None:
    """By dead reckoning; an override lets it hover in the middle."""
    bench = landing()
    for _ in range(6):
        live(bench, velocity=BodyVelocity(forward_mps=0.2), flying=FlyingState.FLYING)
    live(bench, movement=ended(bench, MovementState.INTERRUPTED))
    assert step(bench).id == 2
    assert step(bench).forward_m == pytest.approx(0.04, abs=0.01)


def test_where_a_person_flew_it_or_it_is_landing_already_there_it_lands() -> None:
    bench = landing()
    live(bench)
    live(bench, seconds=10.0, movement=ended(bench, MovementState.INTERRUPTED))
    assert bench.proposed == LandCommand()
    bench = landing()
    live(bench, flying=FlyingState.LANDING, height_m=0.3)
    assert bench.proposed == LandCommand()


@pytest.mark.parametrize("word", [MovementState.INTERRUPTED, MovementState.REJECTED])
def test_kept_from_the_step_it_lands_all_the_same(word: MovementState) -> None:
    """Fifteen centimetres off is better than flying on."""
    bench = LeafBench(Land)
    live(bench)
    for _ in range(60):
        show(bench)
        if isinstance(bench.proposed, MoveBy):
            bench.finish_movement(word)
        bench.tick()
    assert bench.proposed == LandCommand()


def test_on_the_ground_there_is_nothing_to_do() -> None:
    """A mission that needed an emergency landing has failed."""
    for leaf, status in ((Land, Status.SUCCESS), (EmergencyLand, Status.FAILURE)):
        bench = LeafBench(leaf)
        assert live(bench, flying=FlyingState.LANDED) is status
        assert (bench.proposed, bench.pointed) == (None, None)


# EmergencyLand and LandHere.

Lands = type[EmergencyLand | LandHere]
BOTH = pytest.mark.parametrize("leaf", [EmergencyLand, LandHere])
RIGHT = ground()  # only the right of the view is ground
RIGHT[:, :20] = BACKGROUND
NOWHERE = 0 * ground()


def look(bench: LeafBench, ids: NDArray[np.uint8] | None = None, **world: Any) -> Status:
    """Let the leaf look straight down."""
    return live(bench, ids=ids, gimbal_deg=-90.0, **world)


@BOTH
def test_moves_to_the_spot_and_lands(leaf: Lands) -> None:
    bench = LeafBench(leaf, radius_m=0.15)
    look(bench, RIGHT)
    assert step(bench).right_m > 0.2
    assert bench.pointed == DOWN
    look(bench, movement=ended(bench))
    assert bench.proposed == LandCommand()
    status = Status.FAILURE if leaf is EmergencyLand else Status.SUCCESS
    assert live(bench, flying=FlyingState.LANDED) is status
    assert (bench.proposed, bench.pointed) == (None, None)


@pytest.mark.parametrize("missing", [None, FRAME, CLASS_MAP, CAMERA])
def test_without_ground_in_view_it_lands_after_a_while(missing: Key[Any] | None) -> None:
    """It looks for a few seconds, blind or not; then anywhere is better than nowhere."""
    bench = LeafBench(EmergencyLand, look_s=2.0)

    def blind(*seconds: float) -> None:
        for each in seconds:
            show(bench, seconds=each, gimbal_deg=-90.0, ids=NOWHERE)
            if missing is not None:
                del bench.board[missing]
            assert bench.tick() is Status.RUNNING

    blind(0.1)
    assert (bench.proposed, bench.pointed) == (None, DOWN)
    # For 60 s a person flies; the time to look begins anew.
    blind(*[0.2] * 9, 60.0, *[0.2] * 10)
    assert bench.proposed is None
    blind(0.2, 0.2)
    assert bench.proposed == LandCommand()


@BOTH
def test_after_a_take_over_in_the_descent_it_looks_again(leaf: Lands) -> None:
    bench = LeafBench(leaf)
    for _ in range(2):
        look(bench)
    assert bench.proposed == LandCommand()
    look(bench, NOWHERE, seconds=10.0)
    assert bench.proposed is None
    for _ in range(2):
        look(bench)
    assert bench.proposed == LandCommand()


def test_flown_elsewhere_by_a_person_it_looks_for_a_new_spot() -> None:
    bench = LeafBench(EmergencyLand, radius_m=0.15)
    look(bench, RIGHT)
    first = step(bench)
    look(bench, RIGHT, seconds=10.0, movement=ended(bench, MovementState.INTERRUPTED))
    assert step(bench).id != first.id
    look(bench, movement=ended(bench))
    assert bench.proposed == LandCommand()


def test_a_disc_smaller_than_the_hull_is_not_enough() -> None:
    """Boxes begin 10 cm right of the body: it moves away from them, whatever the port says."""
    ids = ground()
    ids[:, 18:] = BOXES[0]
    bench = LeafBench(EmergencyLand, radius_m=0.05)
    look(bench, ids)
    assert step(bench).right_m < -0.05


def test_where_no_place_has_a_margin_it_takes_one_that_holds_the_hull() -> None:
    """A strip of ground 0.45 m wide between boxes: 0.40 m is the hull, 0.50 m with its margin."""
    ids = np.full((18, 32), BOXES[0], dtype=np.uint8)
    ids[:, 20:27] = CARPET  # a pixel shows 6.4 cm at 1.5 m
    bench = LeafBench(EmergencyLand, look_s=1.0)
    for _ in range(10):
        assert look(bench, ids) is Status.RUNNING
        assert bench.proposed is None
    for _ in range(2):
        look(bench, ids)
    assert step(bench).right_m > 0.3


@BOTH
def test_only_an_emergency_lands_where_the_step_to_a_place_fails(leaf: Lands) -> None:
    bench = LeafBench(leaf, radius_m=0.15)
    refused: MovementStatus | None = None
    for _ in range(100):
        status = look(bench, RIGHT, movement=refused)
        if isinstance(bench.proposed, MoveBy):
            refused = ended(bench, MovementState.REJECTED)
        elif status is Status.FAILURE or bench.proposed == LandCommand():
            break
    assert (bench.proposed == LandCommand()) is (leaf is EmergencyLand)
    assert (status is Status.FAILURE) is (leaf is LandHere)


def test_without_free_ground_or_telemetry_a_planned_landing_does_not_begin() -> None:
    """Without ground it fails in the air."""
    bench = LeafBench(LandHere, look_s=1.0)
    statuses = [look(bench, NOWHERE, seconds=0.3) for _ in range(6)]
    assert statuses[:3] == [Status.RUNNING] * 3
    assert Status.FAILURE in statuses
    assert bench.proposed is None
    bench = LeafBench(LandHere)
    bench.allow_stale()
    look(bench, NOWHERE)
    assert bench.tick(advance_s=5.0) is Status.RUNNING
    assert bench.proposed is None
