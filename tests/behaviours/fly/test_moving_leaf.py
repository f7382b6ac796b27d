"""The step in hand of a leaf that moves: ends, rests, refusals, pauses."""

import math

import pytest

from behaviours.fly.moving_leaf import RETRIES, RETRY_S, LeafClock, Progress, StepInHand
from uav_bt.board.context import Proposals
from uav_bt.clock import ManualClock
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    MoveBy,
    MovementState,
    MovementStatus,
)

EARLY = [MovementState.INTERRUPTED, MovementState.REJECTED]


def state(
    time_s: float,
    movement_id: int = 0,
    word: MovementState | None = None,
    *,
    yaw_deg: float = 0.0,
    altitude_m: float = 1.5,
    forward_mps: float = 0.0,
) -> DroneState:
    return DroneState(
        captured_s=time_s,
        flying=FlyingState.FLYING,
        movement=MovementStatus(id=movement_id, state=word) if word else None,
        attitude=Attitude(yaw_rad=math.remainder(math.radians(yaw_deg), 2.0 * math.pi)),
        altitude_m=altitude_m,
        velocity=BodyVelocity(forward_mps=forward_mps),
    )


def begun(begin: DroneState, *, resumes: bool = True, **wanted: float) -> tuple[StepInHand, MoveBy]:
    """Return a movement under way, and its first proposal."""
    step = StepInHand(Proposals(), resumes=resumes)
    return step, step.start(MoveBy(id=0, **wanted), begin, begin.captured_s)


def rest_of(step: StepInHand) -> MoveBy:
    assert step.proposal is not None
    return step.proposal


def test_a_movement_is_proposed_until_the_drone_reports_its_end_or_it_is_dropped() -> None:
    step = StepInHand(Proposals())
    assert step.update(state(1.0), 1.0) is Progress.IDLE
    assert (step.proposal, step.busy, step.ended_s) == (None, False, -math.inf)
    first = step.start(MoveBy(id=0, forward_m=0.3), state(0.0), 0.0)
    second = step.start(MoveBy(id=0, forward_m=0.2), state(0.0), 0.0)
    assert second.id != first.id
    assert step.update(state(0.1, first.id, MovementState.DONE), 0.1) is Progress.RUNNING
    assert step.update(state(0.2, second.id, MovementState.RUNNING), 0.2) is Progress.RUNNING
    assert step.proposal == second
    assert step.update(state(0.9, second.id, MovementState.DONE), 1.0) is Progress.DONE
    assert step.ended_s == 1.0
    assert step.update(state(1.1, second.id, MovementState.DONE), 1.1) is Progress.IDLE
    step.start(MoveBy(id=0, forward_m=0.3), state(1.2), 1.2)
    step.drop(1.4)
    step.drop(1.9)
    assert (step.busy, step.ended_s) == (False, 1.4)


@pytest.mark.parametrize(
    ("wanted", "time_s"),
    [({"forward_m": 0.3}, 7.0), ({"down_m": -0.5}, 9.0), ({"yaw_rad": -math.pi}, 19.7)],
)
@pytest.mark.parametrize("pause_s", [0.0, 60.0])
def test_a_movement_that_is_never_acknowledged_ends(
    wanted: dict[str, float], time_s: float, pause_s: float
) -> None:
    """After as long as the slowest drone takes, and some grace; a pause does not count."""
    step, _ = begun(state(10.0), resumes=False, **wanted)
    if pause_s:
        step.pause(pause_s)
    ends_s = 10.0 + pause_s + time_s
    assert step.update(state(0.0), ends_s - 0.1) is Progress.RUNNING
    assert step.update(state(0.0), ends_s + 0.1) is Progress.INTERRUPTED


@pytest.mark.parametrize(
    ("begin_deg", "wanted_deg", "turned_deg"),
    [(0, 90, 30), (170, 90, 30), (-170, -90, -30), (0, 200, 170), (170, 350, 310), (0, -300, -200)],
)
def test_the_rest_of_a_turn_is_measured_by_the_heading(
    begin_deg: int, wanted_deg: int, turned_deg: int
) -> None:
    """Across the south, and for turns longer than half a circle."""
    step, first = begun(state(0.0, yaw_deg=begin_deg), yaw_rad=math.radians(wanted_deg))
    for tick in range(11):
        now = state(tick / 10, yaw_deg=begin_deg + turned_deg * tick / 10)
        assert step.update(now, tick / 10) is Progress.RUNNING
    hovers = state(1.1, first.id, MovementState.INTERRUPTED, yaw_deg=begin_deg + turned_deg)
    assert step.update(hovers, 1.1) is Progress.RUNNING
    rest = rest_of(step)
    assert rest.id != first.id
    assert math.degrees(rest.yaw_rad) == pytest.approx(wanted_deg - turned_deg)
    assert (rest.forward_m, rest.right_m, rest.down_m) == (0.0, 0.0, 0.0)


def test_the_rest_of_a_step_is_dead_reckoned_and_given_from_the_heading_of_now() -> None:
    """0.2 m of 0.5 m straight on were flown when it was turned to the right. It climbed, too."""
    step, first = begun(state(0.0, forward_mps=0.2), forward_m=0.5, down_m=-0.5)
    step.update(state(1.0, forward_mps=0.2), 1.0)
    step.update(state(1.0 + 1e-9, yaw_deg=90), 1.0)
    ended = state(1.1, first.id, MovementState.INTERRUPTED, yaw_deg=90, altitude_m=1.8)
    step.update(ended, 1.1)
    rest = rest_of(step)
    assert (rest.forward_m, rest.right_m) == pytest.approx((0.0, -0.3), abs=1e-6)
    assert rest.down_m == pytest.approx(-0.2)
    assert rest.yaw_rad == 0.0, "nobody asked for a turn"


def test_a_small_rest_is_done() -> None:
    step, first = begun(state(0.0), yaw_rad=math.radians(60))
    ended = state(2.0, first.id, MovementState.INTERRUPTED, yaw_deg=58)
    assert step.update(ended, 2.0) is Progress.DONE
    step, second = begun(state(2.0), yaw_rad=math.radians(60))
    at_the_end = state(3.0, second.id, MovementState.RUNNING, yaw_deg=60)
    assert step.update(at_the_end, 3.0) is Progress.RUNNING
    assert step.update(at_the_end, 30.0) is Progress.DONE


@pytest.mark.parametrize("word", EARLY)
def test_a_movement_without_progress_fails_and_says_why(word: MovementState) -> None:
    """It is tried again at once, then every second, and not proposed between the attempts."""
    step, _ = begun(state(0.0), yaw_rad=math.radians(90))
    attempts, now_s, progress = set(), 0.0, Progress.RUNNING
    while progress is Progress.RUNNING:
        now_s += 0.1
        number = 0 if step.proposal is None else step.proposal.id
        attempts.add(number)
        progress = step.update(state(now_s, number, word if number else None), now_s)
    assert progress is Progress.FAILED
    assert not step.busy
    assert len(attempts - {0}) == RETRIES + 2
    assert now_s > RETRIES * RETRY_S
    assert word.value in step.trouble
    assert "90 deg left" in step.trouble


def test_a_movement_with_progress_is_not_given_up() -> None:
    step, _ = begun(state(0.0), yaw_rad=math.radians(350))
    progress, turned_deg = Progress.RUNNING, 0
    while progress is Progress.RUNNING:
        turned_deg += 10
        word = MovementState.INTERRUPTED
        seen = state(turned_deg / 10, rest_of(step).id, word, yaw_deg=turned_deg)
        progress = step.update(seen, turned_deg / 10)
    assert (progress, turned_deg) == (Progress.DONE, 350)


def test_after_a_pause_a_turn_goes_on_and_a_step_does_not() -> None:
    """The heading stays known after another controller; the position does not."""
    step, turn = begun(state(0.0), yaw_rad=math.radians(90))
    step.pause(10.0)
    seen = state(10.0, turn.id, MovementState.INTERRUPTED, yaw_deg=-20)
    assert step.update(seen, 10.0) is Progress.RUNNING
    assert math.degrees(rest_of(step).yaw_rad) == pytest.approx(110)
    step, ahead = begun(state(10.0), forward_m=0.5)
    step.pause(10.0)
    seen = state(20.0, ahead.id, MovementState.INTERRUPTED)
    assert step.update(seen, 20.0) is Progress.INTERRUPTED
    assert step.proposal is None


def test_a_pause_between_two_ticks_of_one_activation_does_not_count() -> None:
    """Ticks of up to a second do. Between two activations there is no pause."""
    clock = ManualClock()
    own = LeafClock(clock)
    begin_s = own.now()
    for passed_s, paused_s in ((0.0, 0.0), (1.0, 0.0), (30.0, 30.0), (0.5, 0.0)):
        clock.advance(passed_s)
        assert own.tick() == pytest.approx(paused_s)
    assert own.resumed_s == clock.now() - 0.5
    assert own.now() - begin_s == pytest.approx(1.5)
    own.stop()
    clock.advance(30.0)
    assert own.tick() == 0.0
    assert own.now() - begin_s == pytest.approx(31.5)
