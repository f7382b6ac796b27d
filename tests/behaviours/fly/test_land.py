"""Land, LandHere and EmergencyLand: where to, how, until the motors are off."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.fly.land import MARGIN_M, EmergencyLand, Land, LandHere, nearest_landing_spot
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds import values
from tests.worlds.leaves import ended, step
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, PHASE, STATE
from uav_bt.board.blackboard import Key
from uav_bt.lab.shipped import default_mark
from uav_bt.testing import LeafBench, pinhole
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
from uav_bt.types.projection import ground_points

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


# The spot: a disc on one surface, never across the landing box's rim.

HEIGHT_M = 1.5
CAMERA_DOWN = pinhole(161, 91)
PX_PER_M = CAMERA_DOWN.fx_px / HEIGHT_M
ALL_GROUND = np.full((91, 161), CARPET, dtype=np.uint8)
TOP_M = 0.4  # of the landing box above the ground
HALF_M = 0.25  # of its side
PIXEL_M = 1.0 / PX_PER_M


def spot(
    ids: NDArray[np.uint8],
    radius_m: float = 0.25,
    mark_m: float = default_mark().height_m,
    height_m: float = HEIGHT_M,
) -> tuple[float, float] | None:
    seen, frame = paper_map(ids), values.frame((91, 161), -math.pi / 2, height_m)
    return nearest_landing_spot(seen, CAMERA_DOWN, frame, radius_m=radius_m, mark_m=mark_m)


@pytest.mark.parametrize(("radius_m", "fits"), [(0.1, True), (0.45, True), (0.55, False)])
def test_on_open_ground_the_spot_is_right_below(radius_m: float, *, fits: bool) -> None:
    """As near to the body's centre, behind the camera, as the view allows to know.

    The larger radii are shares of the view's height: a disc must fit into the view.
    """
    found = spot(ALL_GROUND, radius_m if radius_m < 0.4 else radius_m * 91 / PX_PER_M)
    assert (found is not None) == fits
    assert radius_m > 0.4 or found == pytest.approx((0.0, 0.0), abs=1.5 / PX_PER_M)


def test_the_spot_keeps_clear_of_a_box() -> None:
    ids = ALL_GROUND.copy()
    ids[:, :95] = BOXES[0]
    found = spot(ids)
    edge_m = (95 - 0.5 - CAMERA_DOWN.cx_px) / PX_PER_M
    assert found is not None
    assert found[1] == pytest.approx(edge_m + 0.25, abs=1.5 / PX_PER_M)


def view_of_box(
    forward_m: tuple[float, float],
    right_m: tuple[float, float],
    around: int = CARPET,
    top_m: float = TOP_M,
) -> NDArray[np.uint8]:
    """Return the class map of a box, from the body's centre: its top, and the sides in view."""
    pixels = np.stack(np.meshgrid(np.arange(161), np.arange(91)), axis=-1)
    ids = np.full((91, 161), around, dtype=np.uint8)
    for level_m in np.linspace(0.0, top_m, 60):
        places = ground_points(pixels, CAMERA_DOWN, -math.pi / 2, HEIGHT_M - level_m)
        ahead, right = places[..., 0] + CAMERA_DOWN.forward_offset_m, places[..., 1]
        inside = (forward_m[0] <= ahead) & (ahead <= forward_m[1])
        ids[inside & (right_m[0] <= right) & (right <= right_m[1])] = HELIPAD_BOX
    return ids


def rim_m(found: tuple[float, float], centre: tuple[float, float]) -> float:
    """Return the distance from a spot to the box's outline: negative on the box."""
    beyond = [abs(at - middle) - HALF_M for at, middle in zip(found, centre, strict=True)]
    outside = math.hypot(*(max(0.0, each) for each in beyond))
    return outside if outside > 0.0 else max(beyond)


@pytest.mark.parametrize("ahead_m", [-0.5, -0.25, 0.0, 0.2, 0.4, 0.7])
@pytest.mark.parametrize("right_m", [-0.6, -0.3, -0.15, 0.0, 0.1, 0.25, 0.5])
def test_a_disc_never_lies_across_the_rim(ahead_m: float, right_m: float) -> None:
    """From wherever the box is seen, the hull's 0.2 m lie whole on it or whole beside it."""
    box = [(at - HALF_M, at + HALF_M) for at in (ahead_m, right_m)]
    found = spot(view_of_box(box[0], box[1]), radius_m=0.2)
    assert found is not None
    assert abs(rim_m(found, (ahead_m, right_m))) >= 0.2 - 1.5 * PIXEL_M


@pytest.mark.parametrize("right_m", [-0.5, 0.0, 0.3, 0.6])
def test_the_side_of_the_box_is_no_place_to_land(right_m: float) -> None:
    """Only the box is free: the spot is on its top, though its side is seen before it.

    It does not hold a disc of 0.3 m radius, though box and side fill more pixels.
    """
    box = view_of_box((-0.1, 0.4), (right_m - HALF_M, right_m + HALF_M), around=BACKGROUND)
    found = spot(box, radius_m=0.15)
    assert found is not None
    assert rim_m(found, (0.15, right_m)) <= -0.15 + 1.5 * PIXEL_M
    assert spot(box, radius_m=0.3) is None


def test_from_below_the_top_only_the_ground_counts() -> None:
    assert spot(np.full_like(ALL_GROUND, HELIPAD_BOX), 0.05, TOP_M, height_m=0.4) is None


def test_the_height_of_the_mark_decides_how_large_its_top_is() -> None:
    """From 1.5 m the same pixels are 0.5 m across on a box of 0.4 m and 0.66 m on a mat."""
    ids = np.full((91, 161), BOXES[0], dtype=np.uint8)
    half_px = round(0.25 * CAMERA_DOWN.fx_px / (HEIGHT_M - TOP_M))
    rows, columns = (
        slice(round(each) - half_px, round(each) + half_px + 1)
        for each in (CAMERA_DOWN.cy_px, CAMERA_DOWN.cx_px)
    )
    ids[rows, columns] = HELIPAD_H
    wide_m = 0.25 * HEIGHT_M / (HEIGHT_M - TOP_M)
    assert spot(ids, 0.9 * wide_m, mark_m=0.05) is not None
    assert spot(ids, 0.9 * wide_m, mark_m=TOP_M) is None


def test_an_emergency_landing_takes_a_mat_for_what_it_is() -> None:
    """A mat of 0.05 m and 0.6 m a side, the only surface: its middle holds hull and margin."""
    bench = LeafBench(EmergencyLand)
    bench.camera = CAMERA_DOWN
    bench.provide(mark=LandingMark(length_m=0.6, width_m=0.6, height_m=0.05))
    look(bench, view_of_box((-0.1, 0.5), (0.3, 0.9), around=BACKGROUND, top_m=0.05))
    spot_m, hull_m = step(bench), bench.leaf.mission.airframe.radius_m + MARGIN_M
    assert 0.3 + hull_m - 0.03 <= spot_m.right_m <= 0.9 - hull_m + 0.03
    assert -0.1 + hull_m - 0.03 <= spot_m.forward_m <= 0.5 - hull_m + 0.03
