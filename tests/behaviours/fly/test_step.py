"""The keeper of one movement: proposed until the drone says it ended, resumed when too early."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.step import MovementConfig, Progress, StepInHand
from uav_bt.board.context import Proposals
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


def step_of(**settings: bool) -> StepInHand:
    return StepInHand(Proposals(), **settings)


def proposed(step: StepInHand) -> MoveBy:
    assert step.proposal is not None
    return step.proposal


def test_idle_at_first() -> None:
    """Nothing to propose, nothing ended yet."""
    step = step_of()

    assert step.update(state(1.0), 1.0) is Progress.IDLE
    assert step.proposal is None
    assert not step.busy
    assert step.ended_s == -math.inf


def test_running_until_the_drone_says_done() -> None:
    """Silence and 'running' keep it; it has ended when that is heard, however old attitude is."""
    step = step_of()
    move = step.start(state(0.0), 0.0, forward_m=0.3)

    assert step.update(state(0.1), 0.1) is Progress.RUNNING
    assert step.update(state(0.2, move.id, MovementState.RUNNING), 0.2) is Progress.RUNNING
    assert step.proposal == move
    assert step.update(state(0.9, move.id, MovementState.DONE), 1.0) is Progress.DONE
    assert step.ended_s == 1.0
    assert step.update(state(1.1, move.id, MovementState.DONE), 1.1) is Progress.IDLE


@pytest.mark.parametrize("word", EARLY)
def test_one_that_does_not_resume_has_ended(word: MovementState) -> None:
    """Its owner decides anew."""
    step = step_of(resumes=False)
    move = step.start(state(0.0), 0.0, forward_m=0.3)

    assert step.update(state(0.1, move.id, word), 0.1) is Progress.INTERRUPTED
    assert not step.busy


def test_the_word_on_another_movement_does_not_count() -> None:
    """The drone may still speak of the movement before."""
    step = step_of()
    first = step.start(state(0.0), 0.0, forward_m=0.3)
    second = step.start(state(0.1), 0.1, forward_m=0.2)

    assert second.id != first.id
    assert step.update(state(0.2, first.id, MovementState.DONE), 0.2) is Progress.RUNNING
    assert step.proposal == second


@pytest.mark.parametrize(
    ("movement", "patience_s"),
    [({"forward_m": 0.3}, 7.0), ({"down_m": -0.5}, 9.0), ({"yaw_rad": -math.pi}, 19.7)],
)
def test_a_movement_that_is_never_acknowledged_ends(
    movement: dict[str, float], patience_s: float
) -> None:
    """After as long as the slowest drone would take, and some grace."""
    step = step_of(resumes=False)
    step.start(state(10.0), 10.0, **movement)

    assert step.update(state(0.0), 10.0 + patience_s - 0.1) is Progress.RUNNING
    assert step.update(state(0.0), 10.0 + patience_s + 0.1) is Progress.INTERRUPTED


def test_dropping_ends_it_now() -> None:
    """A dropped movement ends when it is dropped; dropping nothing changes nothing."""
    step = step_of()
    step.start(state(0.0), 0.0, forward_m=0.3)
    step.drop(0.4)
    step.drop(0.9)

    assert not step.busy
    assert step.ended_s == 0.4


# --- resuming ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted_deg", "turned_deg"), [(90, 30), (-90, -30), (200, 170), (350, 310), (-300, -200)]
)
@pytest.mark.parametrize("begin_deg", [0, 170, -170])
def test_the_rest_of_a_turn_is_measured_by_the_heading(
    begin_deg: int, wanted_deg: int, turned_deg: int
) -> None:
    """Across the south, and for turns longer than half a circle."""
    step = step_of()
    first = step.start(state(0.0, yaw_deg=begin_deg), 0.0, yaw_rad=math.radians(wanted_deg))
    for tick in range(11):
        now = state(tick / 10, yaw_deg=begin_deg + turned_deg * tick / 10)
        assert step.update(now, tick / 10) is Progress.RUNNING
    hovers = state(1.1, first.id, MovementState.INTERRUPTED, yaw_deg=begin_deg + turned_deg)

    assert step.update(hovers, 1.1) is Progress.RUNNING
    rest = proposed(step)
    assert rest.id != first.id
    assert math.degrees(rest.yaw_rad) == pytest.approx(wanted_deg - turned_deg)
    assert (rest.forward_m, rest.right_m, rest.down_m) == (0.0, 0.0, 0.0)


def test_the_rest_of_a_climb_is_measured_by_the_altimeter() -> None:
    step = step_of()
    first = step.start(state(0.0, altitude_m=1.0), 0.0, down_m=-0.5)
    step.update(state(1.0, first.id, MovementState.INTERRUPTED, altitude_m=1.3), 1.0)

    assert proposed(step).down_m == pytest.approx(-0.2)


def test_the_rest_of_a_step_is_dead_reckoned_and_given_from_the_heading_of_now() -> None:
    """0.2 m of 0.5 m straight on were flown when it was turned to the right."""
    step = step_of()
    first = step.start(state(0.0, forward_mps=0.2), 0.0, forward_m=0.5)
    step.update(state(1.0, forward_mps=0.2), 1.0)
    step.update(state(1.0 + 1e-9, yaw_deg=90), 1.0)
    step.update(state(1.1, first.id, MovementState.INTERRUPTED, yaw_deg=90), 1.1)

    rest = proposed(step)
    assert (rest.forward_m, rest.right_m) == pytest.approx((0.0, -0.3), abs=1e-6)
    assert rest.yaw_rad == 0.0, "nobody asked for a turn"


def test_what_is_hardly_left_is_done() -> None:
    """So is a turn whose end the drone never reported."""
    step = step_of()
    first = step.start(state(0.0), 0.0, yaw_rad=math.radians(60))
    ended = state(2.0, first.id, MovementState.INTERRUPTED, yaw_deg=58)
    assert step.update(ended, 2.0) is Progress.DONE

    second = step.start(state(2.0), 2.0, yaw_rad=math.radians(60))
    at_the_end = state(3.0, second.id, MovementState.RUNNING, yaw_deg=60)
    assert step.update(at_the_end, 3.0) is Progress.RUNNING
    assert step.update(at_the_end, 30.0) is Progress.DONE


@pytest.mark.parametrize("word", EARLY)
def test_refused_again_and_again_it_fails_and_says_so(word: MovementState) -> None:
    """At once, then every second; nothing is proposed between the attempts."""
    config, step = MovementConfig(), step_of()
    step.start(state(0.0), 0.0, yaw_rad=math.radians(90))
    attempts, now_s, progress = set(), 0.0, Progress.RUNNING
    while progress is Progress.RUNNING:
        now_s += 0.1
        if step.proposal is not None:
            attempts.add(step.proposal.id)
            progress = step.update(state(now_s, step.proposal.id, word), now_s)
        else:
            progress = step.update(state(now_s), now_s)

    assert progress is Progress.FAILED
    assert not step.busy
    assert len(attempts) == config.retries + 2
    assert now_s > config.retries * config.retry_s
    assert word.value in step.trouble
    assert "90 deg left" in step.trouble


def test_as_long_as_it_gets_on_it_is_not_given_up() -> None:
    """Interrupted after every ten degrees it still turns round."""
    step = step_of()
    step.start(state(0.0), 0.0, yaw_rad=math.radians(350))
    progress, turned_deg = Progress.RUNNING, 0
    while progress is Progress.RUNNING:
        turned_deg += 10
        seen = state(
            turned_deg / 10, proposed(step).id, MovementState.INTERRUPTED, yaw_deg=turned_deg
        )
        progress = step.update(seen, turned_deg / 10)

    assert (progress, turned_deg) == (Progress.DONE, 350)


# --- pauses -----------------------------------------------------------------------------------


def test_a_pause_does_not_use_up_the_time() -> None:
    step = step_of(resumes=False)
    step.start(state(0.0), 0.0, forward_m=0.3)
    step.pause(60.0)

    assert step.update(state(66.9), 66.9) is Progress.RUNNING
    assert step.update(state(67.1), 67.1) is Progress.INTERRUPTED


def test_a_turn_goes_on_after_a_pause_and_a_step_does_not() -> None:
    """The heading stays known after another controller; the position does not."""
    step = step_of()
    turn = step.start(state(0.0), 0.0, yaw_rad=math.radians(90))
    step.pause(10.0)
    seen = state(10.0, turn.id, MovementState.INTERRUPTED, yaw_deg=-20)
    assert step.update(seen, 10.0) is Progress.RUNNING
    assert math.degrees(proposed(step).yaw_rad) == pytest.approx(110)

    ahead = step.start(state(10.0), 10.0, forward_m=0.5)
    step.pause(10.0)
    seen = state(20.0, ahead.id, MovementState.INTERRUPTED)
    assert step.update(seen, 20.0) is Progress.INTERRUPTED
    assert step.proposal is None
