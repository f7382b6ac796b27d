"""Centring over the mark, and the controller of the heading."""

import math
from dataclasses import replace

import pytest

from behaviours.fly.heading_control import HeadingController, HeadingGains
from behaviours.fly.helipad_center import HelipadCenter
from tests.perception.marks.mark_views import tag_mark
from tests.worlds.leaves import step, velocity
from tests.worlds.values import fix
from uav_bt.board import FRAME, MARK, PHASE
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import show
from uav_bt.tree import Status
from uav_bt.types import GimbalTo, MoveBy, MovementState, MovementStatus, Velocity

DOWN = GimbalTo(pitch_rad=-math.pi / 2)
CAMERA_FORWARD_M = 0.15


def look(
    bench: LeafBench,
    offset_m: tuple[float, float] | None,
    *,
    seconds: float = 0.1,
    height_m: float = 1.7,
    gimbal_deg: float = -90.0,
    ended: int | None = None,
    word: MovementState = MovementState.DONE,
    heading_deg: float | None = None,
) -> Status:
    """Tick with the pad in view, ahead and right of the camera; None: not in view."""
    movement = MovementStatus(id=ended, state=word) if ended is not None else None
    show(bench, seconds=seconds, height_m=height_m, gimbal_deg=gimbal_deg, movement=movement)
    if offset_m is not None:
        ahead_m, now_s = offset_m[0] + CAMERA_FORWARD_M, bench.clock.now()
        bench.board[MARK] = fix(now_s, ahead_m, offset_m[1], heading_deg=heading_deg)
    else:
        del bench.board[MARK]
    return bench.tick()


def search(bench: LeafBench, seconds: float, **world: float) -> Status:
    """Go on without the pad in view, tick by tick."""
    status = Status.RUNNING
    for _ in range(round(seconds / 0.1)):
        status = look(bench, None, **world)
    return status


def climbed(**attributes: object) -> LeafBench:
    """Return a bench whose leaf has climbed and looks down; its movement had the id 1."""
    bench = LeafBench(HelipadCenter, **attributes)
    assert look(bench, None, height_m=1.5) is Status.RUNNING
    return bench


def test_flies_towards_the_pad_in_proportion() -> None:
    """The camera, not the body, goes above the centre, and slows down near it.

    A calibrated camera's offset counts, not the nominal one.
    """
    bench = climbed()
    look(bench, (0.15, -0.2), seconds=1.0, ended=1)
    far = velocity(bench)
    look(bench, (0.06, -0.08))
    near = velocity(bench)
    assert far.forward_mps / 0.15 == pytest.approx(far.right_mps / -0.2)
    assert near.forward_mps == pytest.approx(0.4 * far.forward_mps)
    assert near.right_mps == pytest.approx(0.4 * far.right_mps)
    assert far.forward_mps > 0.0
    bench.camera = replace(bench.camera, forward_offset_m=CAMERA_FORWARD_M - 0.08)
    look(bench, (-0.02, -0.08))
    assert velocity(bench).forward_mps == pytest.approx(near.forward_mps)


def test_between_two_frames_it_flies_on_but_not_blindly() -> None:
    bench = climbed()
    look(bench, (0.1, 0.0), seconds=1.0, ended=1)
    course = velocity(bench)
    assert search(bench, 0.2) is Status.RUNNING
    assert velocity(bench) == course
    search(bench, 0.2)
    assert bench.proposed is None


def test_centred_twice_then_lower_then_centred_again() -> None:
    """Two looks in a row agree, high up and again low down; then success, proposing nothing."""
    bench = climbed(tolerance_m=0.04, low_m=1.1)
    look(bench, (0.01, 0.02), seconds=1.0, ended=1)
    for offset_m in ((0.1, 0.0), (0.01, 0.02)):
        look(bench, offset_m)
    assert velocity(bench).right_mps > 0.0  # it flies on, since the looks were not in a row
    assert look(bench, (0.01, 0.02)) is Status.RUNNING
    descent = step(bench)
    assert descent.down_m == pytest.approx(1.7 - 1.1)
    assert look(bench, (0.0, 0.02), seconds=1.5, height_m=1.1, ended=descent.id) is Status.RUNNING
    assert look(bench, (0.0, 0.02), height_m=1.1) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


@pytest.mark.parametrize("why", ["gimbal", "tracked", "no frame", "late"])
def test_only_what_is_seen_from_above_counts(why: str) -> None:
    """Not while the camera tilts, not a track without a detection, not without a frame.

    Nor a look from before the movement ended: video is late, and shows the pad from elsewhere.
    """
    bench = climbed()
    gimbal_deg = -60.0 if why == "gimbal" else -90.0
    movement = MovementStatus(id=1, state=MovementState.DONE)
    show(bench, seconds=1.0, height_m=1.7, gimbal_deg=gimbal_deg, movement=movement)
    captured_s = bench.clock.now() - (0.15 if why == "late" else 0.0)
    bench.board[MARK] = fix(captured_s, 0.6, detected=why != "tracked")
    if why == "no frame":
        del bench.board[FRAME]
    assert bench.tick() is Status.RUNNING
    assert bench.proposed is None


def test_it_climbs_first_and_without_a_sight_of_the_pad_looks_from_higher() -> None:
    """After a second at one height, up to the ceiling; then it waits there."""
    bench = climbed(climb_m=0.2)
    assert step(bench) == MoveBy(id=1, down_m=-0.2)
    assert (bench.pointed, bench.board[PHASE]) == (DOWN, "center")
    look(bench, None, seconds=1.0, ended=1)
    assert bench.proposed is None
    search(bench, 1.1)
    second = step(bench)
    assert second.down_m == pytest.approx(-0.2)
    look(bench, None, seconds=1.0, ended=second.id, height_m=2.3)
    search(bench, 1.1, height_m=2.3)
    assert bench.proposed is None


def test_time_in_which_a_person_flies_does_not_count() -> None:
    """Neither until it climbs for a wider view nor until the pad is lost."""
    bench = climbed(give_up_s=5.0)
    look(bench, None, seconds=1.0, ended=1)
    search(bench, 0.5)
    assert look(bench, None, seconds=60.0) is Status.RUNNING
    search(bench, 0.9)
    assert bench.proposed is None
    search(bench, 0.2)
    assert step(bench).down_m < 0.0


@pytest.mark.parametrize("seconds", [0.1, 10.0])
def test_an_interrupted_descent_goes_on_and_is_not_taken_for_flown(seconds: float) -> None:
    """The altimeter gives the remaining descent, also after a take-over."""
    bench = climbed(low_m=1.1)
    look(bench, (0.0, 0.0), seconds=1.0, ended=1)
    look(bench, (0.0, 0.0))
    descent = step(bench)
    over = MovementState.INTERRUPTED
    look(bench, (0.0, 0.0), seconds=seconds, height_m=1.5, ended=descent.id, word=over)
    assert step(bench).id != descent.id
    assert step(bench).down_m == pytest.approx(1.5 - 1.1)


def test_lost_for_too_long_is_a_failure() -> None:
    bench = climbed(give_up_s=5.0)
    look(bench, None, seconds=1.0, ended=1, height_m=2.3)
    assert search(bench, 3.9, height_m=2.3) is Status.RUNNING
    assert search(bench, 0.2, height_m=2.3) is Status.FAILURE
    assert (bench.proposed, bench.pointed) == (None, None)
    assert bench.feedback == "mark lost: not centred in 5 s"
    (event,) = bench.notes.events
    assert (event.kind, event.text) == ("failed", f"HelipadCenter: {bench.feedback}")


TAG = tag_mark(height_m=0.0)


def test_turns_the_short_way_to_the_wanted_heading() -> None:
    for seen_deg, wanted, turn_deg in (
        (30.0, "90", 60.0),
        (170.0, "-170", 20.0),
        (5.0, "0", -5.0),
        (88.0, "90", None),  # within the slack
        (30.0, "any", None),
        (None, "90", None),
    ):
        bench = LeafBench(HelipadCenter, heading_deg=wanted)
        bench.provide(mark=TAG)
        look(bench, None, height_m=1.5)
        look(bench, (0.0, 0.0), seconds=1.0, ended=1, heading_deg=seen_deg)
        if turn_deg is None:
            assert isinstance(bench.proposed, Velocity)
        else:
            assert step(bench).yaw_rad == pytest.approx(math.radians(turn_deg))


def test_a_heading_is_a_number_and_needs_a_mark_that_shows_it() -> None:
    with pytest.raises(InputError, match="kind 'helipad' does not"):
        look(LeafBench(HelipadCenter, heading_deg="90"), None)
    with pytest.raises(InputError, match="expected any, or degrees from -360 to 360, got 'north'"):
        LeafBench(HelipadCenter, heading_deg="north")


@pytest.mark.parametrize(("mark_m", "low_m"), [(0.0, 1.1), (0.4, 1.1), (0.6, 1.3)])
def test_centres_again_above_the_mark_as_high_as_it_is(mark_m: float, low_m: float) -> None:
    """From less than 0.7 m above, a pad of half a metre does not fit into the view."""
    bench = LeafBench(HelipadCenter)
    bench.provide(mark=replace(TAG, height_m=mark_m))
    look(bench, None, height_m=1.5)
    look(bench, (0.0, 0.0), seconds=1.0, ended=1)
    look(bench, (0.0, 0.0))
    assert step(bench).down_m == pytest.approx(1.7 - low_m)


# --- the heading controller -----------------------------------------------------------------------

TICK_S = 0.1


def test_the_first_answer_is_proportional_and_the_rate_is_limited() -> None:
    """Without a past there is neither integral nor derivative; clockwise is positive."""
    gains = HeadingGains(proportional=1.5, max_yaw_rate_radps=0.6)
    assert HeadingController(gains).update(0.2, 7.0) == pytest.approx(0.3, abs=1e-6)
    assert HeadingController(gains).update(-0.2, 7.0) == pytest.approx(-0.3, abs=1e-6)
    controller = HeadingController(gains)
    assert controller.update(math.pi, 0.0) == pytest.approx(0.6)
    assert controller.update(-math.pi, TICK_S) == pytest.approx(-0.6)


def test_the_integral_removes_a_steady_drift() -> None:
    controller, drift_radps = HeadingController(), 0.08
    bearing, bearings = 0.0, []
    for tick in range(600):
        rate = controller.update(bearing, TICK_S * tick)
        bearing += TICK_S * (drift_radps - rate)
        bearings.append(bearing)
    without = drift_radps / controller.gains.proportional
    assert max(bearings) > 0.5 * without
    assert abs(bearings[-1]) < 0.05 * without


def test_long_saturation_leaves_no_windup() -> None:
    controller = HeadingController()
    for tick in range(600):  # something keeps the drone from turning
        assert controller.update(2.5, TICK_S * tick) == pytest.approx(1.0)
    bearing, overshoot = 2.5, 0.0
    for tick in range(600, 700):
        bearing -= TICK_S * controller.update(bearing, TICK_S * tick)
        overshoot = max(overshoot, -bearing)
    assert abs(bearing) < math.radians(1)
    assert overshoot < math.radians(1)


def test_after_a_reset_it_answers_as_a_new_one_and_to_a_second_call_at_one_time_the_same() -> None:
    used, fresh = HeadingController(), HeadingController()
    for tick in range(50):
        used.update(0.15, 100.0 + TICK_S * tick)
    used.reset()
    for now_s, bearing in ((0.0, -0.1), (0.1, -0.05), (0.2, 0.02)):
        answer = used.update(bearing, now_s)
        assert answer == fresh.update(bearing, now_s)
    for now_s in (0.2, 0.15):
        assert used.update(0.5, now_s) == answer
