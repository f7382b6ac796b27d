"""Land and EmergencyLand: where to, how, until the motors are off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.land import MARGIN_M, EmergencyLand, Land, LandHere
from tests.behaviours.fly.test_landing_spot import CAMERA_DOWN, view_of_box
from tests.paper_lab import BACKGROUND, BOXES, CARPET
from tests.worlds.values import fix
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, PHASE, STATE
from uav_bt.testing import LeafBench
from uav_bt.testing.world import ground, live, show
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    FlyingState,
    GimbalTo,
    LandingMark,
    MoveBy,
    MovementState,
    MovementStatus,
)
from uav_bt.types import Land as LandCommand

DOWN = GimbalTo(pitch_rad=-math.pi / 2)


# --- Land -----------------------------------------------------------------------------------------


def bench_with_lens(forward_offset_m: float) -> LeafBench:
    bench = LeafBench(Land)
    bench.camera = replace(bench.camera, forward_offset_m=forward_offset_m)
    return bench


def test_steps_forward_then_lands() -> None:
    """The camera hangs over the pad's centre, the body behind it: forward, then down."""
    bench = bench_with_lens(0.15)
    assert live(bench) is Status.RUNNING
    step = bench.proposed
    assert step == MoveBy(id=1, forward_m=0.15)
    assert bench.board[PHASE] == "land"
    live(bench)
    assert bench.proposed == step

    done = MovementStatus(id=1, state=MovementState.DONE)
    assert live(bench, movement=done) is Status.RUNNING
    assert bench.proposed == LandCommand()
    assert live(bench, flying=FlyingState.LANDING, height_m=0.6) is Status.RUNNING
    assert bench.proposed == LandCommand()

    assert live(bench, flying=FlyingState.LANDED, height_m=0.0) is Status.SUCCESS
    assert bench.proposed is None


def test_a_landing_that_has_begun_goes_on_without_telemetry() -> None:
    bench = bench_with_lens(0.0)
    bench.allow_stale()
    live(bench)
    assert bench.tick(advance_s=0.8) is Status.RUNNING
    assert bench.proposed == LandCommand()


def test_before_the_step_is_done_it_waits_for_telemetry_and_then_lands_where_it_is() -> None:
    bench = bench_with_lens(0.15)
    bench.allow_stale()
    live(bench)
    bench.tick(advance_s=0.8)
    assert bench.proposed is None
    bench.tick(advance_s=1.5)
    assert bench.proposed == LandCommand()


def test_without_a_frame_for_long_the_step_is_left_out() -> None:
    bench = bench_with_lens(0.15)
    live(bench)
    bench.allow_stale()
    proposed = []
    for _ in range(25):
        bench.clock.advance(0.1)
        state = bench.board[STATE]
        bench.board[STATE] = replace(state, captured_s=bench.clock.now())
        bench.tick()
        proposed.append(bench.proposed)

    assert proposed[:19] == [MoveBy(id=1, forward_m=0.15)] * 19
    assert proposed[-1] == LandCommand()


def test_frames_that_return_do_not_take_a_landing_back() -> None:
    bench = bench_with_lens(0.15)
    live(bench)
    bench.allow_stale()
    for _ in range(25):
        bench.clock.advance(0.1)
        bench.board[STATE] = replace(bench.board[STATE], captured_s=bench.clock.now())
        bench.tick()
    for flying in (FlyingState.HOVERING, FlyingState.LANDING):
        live(bench, flying=flying)
        assert bench.proposed == LandCommand()


def test_a_drone_that_is_landing_already_makes_no_step() -> None:
    bench = bench_with_lens(0.15)
    live(bench, flying=FlyingState.LANDING, height_m=0.3)
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


def test_the_step_is_as_long_as_the_camera_is_ahead() -> None:
    """A calibrated camera says where its lens sits; no other number is asked."""
    bench = bench_with_lens(0.07)
    live(bench)

    assert bench.proposed == MoveBy(id=1, forward_m=0.07)


def test_an_interrupted_step_goes_on_with_the_rest() -> None:
    """By dead reckoning; an override lets it hover in the middle."""
    bench = bench_with_lens(0.15)
    flies = {"velocity": BodyVelocity(forward_mps=0.2), "flying": FlyingState.FLYING}
    for _ in range(6):
        live(bench, **flies)
    live(bench, movement=MovementStatus(id=1, state=MovementState.INTERRUPTED))

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.id == 2
    assert bench.proposed.forward_m == pytest.approx(0.04, abs=0.01)


def test_where_a_person_flew_it_there_it_lands() -> None:
    """The step was for another place."""
    bench = bench_with_lens(0.15)
    live(bench)
    live(bench, seconds=10.0, movement=MovementStatus(id=1, state=MovementState.INTERRUPTED))

    assert bench.proposed == LandCommand()


def test_an_emergency_landing_takes_a_mat_for_what_it_is() -> None:
    """A mat of 0.05 m and 0.6 m a side, the only surface: its middle holds hull and margin."""
    bench = LeafBench(EmergencyLand)
    bench.camera = CAMERA_DOWN
    bench.provide(mark=LandingMark(length_m=0.6, width_m=0.6, height_m=0.05))
    mat = view_of_box((-0.1, 0.5), (0.3, 0.9), around=BACKGROUND, top_m=0.05)
    live(bench, ids=mat, gimbal_deg=-90.0)

    step = bench.proposed
    assert isinstance(step, MoveBy)
    hull_m = bench.leaf.mission.airframe.radius_m + MARGIN_M
    assert 0.3 + hull_m - 0.03 <= step.right_m <= 0.9 - hull_m + 0.03
    assert -0.1 + hull_m - 0.03 <= step.forward_m <= 0.5 - hull_m + 0.03


def above_mark(forward_m: float, right_m: float) -> LeafBench:
    """Return a bench whose landing begins with a fix of the mark, from the body's centre."""
    bench = bench_with_lens(0.15)
    bench.board[MARK] = fix(bench.clock.now(), forward_m, right_m, height_m=0.0)
    live(bench)
    return bench


def test_the_fix_corrects_the_step_ahead_and_to_the_side() -> None:
    assert above_mark(0.12, -0.04).proposed == MoveBy(id=1, forward_m=0.12, right_m=-0.04)


def test_a_mark_that_is_not_below_the_lens_is_not_stepped_to() -> None:
    """The mission lands elsewhere on purpose."""
    assert above_mark(0.9, 0.5).proposed == MoveBy(id=1, forward_m=0.15)


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


@pytest.mark.parametrize(
    ("leaf", "status"), [(Land, Status.SUCCESS), (EmergencyLand, Status.FAILURE)]
)
def test_on_the_ground_there_is_nothing_to_do(
    leaf: type[Land | EmergencyLand], status: Status
) -> None:
    """Over at once, nothing proposed; a mission that needed an emergency landing has failed."""
    bench = LeafBench(leaf)

    assert live(bench, flying=FlyingState.LANDED) is status
    assert (bench.proposed, bench.pointed) == (None, None)


# --- EmergencyLand --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("leaf", "ended"), [(EmergencyLand, Status.FAILURE), (LandHere, Status.SUCCESS)]
)
def test_moves_to_the_spot_and_lands(leaf: type[EmergencyLand | LandHere], ended: Status) -> None:
    """Only the right quarter of the view is ground: there, then down."""
    ids = ground()
    ids[:, :20] = BACKGROUND
    bench = LeafBench(leaf, radius_m=0.15)
    live(bench, gimbal_deg=-90.0, ids=ids)
    step = bench.proposed
    assert isinstance(step, MoveBy)
    assert step.right_m > 0.2
    assert bench.pointed == DOWN

    done = MovementStatus(id=step.id, state=MovementState.DONE)
    live(bench, gimbal_deg=-90.0, movement=done)
    assert bench.proposed == LandCommand()
    assert live(bench, flying=FlyingState.LANDED) is ended
    assert (bench.proposed, bench.pointed) == (None, None)


@pytest.mark.parametrize("missing", [None, FRAME, CLASS_MAP, CAMERA])
def test_without_ground_in_view_it_lands_after_a_while(missing: object) -> None:
    """It looks for a few seconds, blind or not; then anywhere is better than nowhere."""
    bench = LeafBench(EmergencyLand, look_s=2.0)

    def blind(seconds: float = 0.2) -> Status:
        show(bench, seconds=seconds, gimbal_deg=-90.0, ids=0 * ground())
        if missing is not None:
            del bench.board[missing]  # type: ignore[arg-type]
        return bench.tick()

    assert blind(0.1) is Status.RUNNING
    assert (bench.proposed, bench.pointed) == (None, DOWN)
    for _ in range(9):
        blind()
    blind(60.0)  # a person flies; the time to look begins anew
    for _ in range(10):
        blind()
    assert bench.proposed is None
    blind()
    blind()

    assert bench.proposed == LandCommand()


@pytest.mark.parametrize("leaf", [EmergencyLand, LandHere])
def test_after_a_take_over_in_the_descent_it_looks_again(
    leaf: type[EmergencyLand | LandHere],
) -> None:
    """The pilot has flown the drone above boxes."""
    bench = LeafBench(leaf)
    live(bench, gimbal_deg=-90.0)
    live(bench, gimbal_deg=-90.0)
    assert bench.proposed == LandCommand()
    live(bench, seconds=10.0, gimbal_deg=-90.0, ids=0 * ground())
    assert bench.proposed is None
    live(bench, gimbal_deg=-90.0)
    live(bench, gimbal_deg=-90.0)
    assert bench.proposed == LandCommand()


def test_flown_elsewhere_by_a_person_it_looks_for_a_new_spot() -> None:
    """The one that it was flying to was seen from another place."""
    ids = ground()
    ids[:, :20] = BACKGROUND
    bench = LeafBench(EmergencyLand, radius_m=0.15)
    live(bench, gimbal_deg=-90.0, ids=ids)
    step = bench.proposed
    assert isinstance(step, MoveBy)
    over = MovementStatus(id=step.id, state=MovementState.INTERRUPTED)
    live(bench, seconds=10.0, gimbal_deg=-90.0, ids=ids, movement=over)

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.id != step.id
    done = MovementStatus(id=bench.proposed.id, state=MovementState.DONE)
    live(bench, gimbal_deg=-90.0, movement=done)
    assert bench.proposed == LandCommand()


def test_a_disc_smaller_than_the_hull_is_not_enough() -> None:
    """Boxes begin 10 cm right of the body: it moves away from them, whatever the port says."""
    ids = ground()
    ids[:, 18:] = BOXES[0]
    bench = LeafBench(EmergencyLand, radius_m=0.05)
    live(bench, gimbal_deg=-90.0, ids=ids)

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.right_m < -0.05


def test_where_no_place_has_a_margin_it_takes_one_that_holds_the_hull() -> None:
    """A strip of ground 0.45 m wide between boxes: 0.40 m is the hull, 0.50 m with its margin."""
    ids = np.full((18, 32), BOXES[0], dtype=np.uint8)
    ids[:, 20:27] = CARPET  # a pixel shows 6.4 cm at 1.5 m
    bench = LeafBench(EmergencyLand, look_s=1.0)
    for _ in range(10):
        assert live(bench, gimbal_deg=-90.0, ids=ids) is Status.RUNNING
        assert bench.proposed is None
    live(bench, gimbal_deg=-90.0, ids=ids)
    live(bench, gimbal_deg=-90.0, ids=ids)

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.right_m > 0.3


# --- LandHere -------------------------------------------------------------------------------------


@pytest.mark.parametrize("leaf", [EmergencyLand, LandHere])
def test_only_an_emergency_lands_where_the_step_to_a_place_fails(
    leaf: type[EmergencyLand | LandHere],
) -> None:
    ids = ground()
    ids[:, :20] = BACKGROUND
    bench = LeafBench(leaf, radius_m=0.15)
    refused: MovementStatus | None = None
    for _ in range(100):
        status = live(bench, gimbal_deg=-90.0, ids=ids, movement=refused)
        if isinstance(bench.proposed, MoveBy):
            refused = MovementStatus(id=bench.proposed.id, state=MovementState.REJECTED)
        elif status is Status.FAILURE or bench.proposed == LandCommand():
            break
    assert (bench.proposed == LandCommand()) is (leaf is EmergencyLand)
    assert (status is Status.FAILURE) is (leaf is LandHere)


def test_without_free_ground_a_planned_landing_fails_in_the_air() -> None:
    bench = LeafBench(LandHere, look_s=1.0)
    statuses = [live(bench, seconds=0.3, gimbal_deg=-90.0, ids=0 * ground()) for _ in range(6)]
    assert statuses[:3] == [Status.RUNNING] * 3
    assert Status.FAILURE in statuses
    assert bench.proposed is None


def test_a_planned_landing_does_not_begin_without_telemetry() -> None:
    bench = LeafBench(LandHere)
    bench.allow_stale()
    live(bench, gimbal_deg=-90.0, ids=0 * ground())
    bench.clock.advance(5.0)
    assert bench.tick() is Status.RUNNING
    assert bench.proposed is None
