"""The keeper of one movement: proposed until the drone says it ended."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.movement import Mover, Progress
from uav_bt.board.context import Proposals
from uav_bt.types import DroneState, FlyingState, MovementState, MovementStatus


def state(time_s: float, movement_id: int = 0, word: MovementState | None = None) -> DroneState:
    status = MovementStatus(id=movement_id, state=word) if word else None
    return DroneState(captured_s=time_s, flying=FlyingState.FLYING, movement=status)


@pytest.fixture
def proposals() -> Proposals:
    """Where ids come from."""
    return Proposals()


def test_idle_at_first() -> None:
    """Nothing to propose, nothing ended yet."""
    mover = Mover()

    assert mover.update(state(1.0), 1.0) is Progress.IDLE
    assert mover.proposal is None
    assert not mover.busy
    assert mover.ended_s == -math.inf


def test_running_until_the_drone_says_done(proposals: Proposals) -> None:
    """Silence and 'running' keep it; it ended when the telemetry was captured."""
    mover = Mover()
    move = mover.start(proposals, 0.0, forward_m=0.3)

    assert mover.update(state(0.1), 0.1) is Progress.RUNNING
    assert mover.update(state(0.2, move.id, MovementState.RUNNING), 0.2) is Progress.RUNNING
    assert mover.proposal == move
    assert mover.update(state(0.9, move.id, MovementState.DONE), 1.0) is Progress.DONE
    assert mover.ended_s == 0.9
    assert mover.update(state(1.1, move.id, MovementState.DONE), 1.1) is Progress.IDLE


@pytest.mark.parametrize("word", [MovementState.INTERRUPTED, MovementState.REJECTED])
def test_interrupted_or_rejected_has_failed(proposals: Proposals, word: MovementState) -> None:
    """Either way the movement is over."""
    mover = Mover()
    move = mover.start(proposals, 0.0, forward_m=0.3)

    assert mover.update(state(0.1, move.id, word), 0.1) is Progress.FAILED
    assert not mover.busy


def test_the_word_on_another_movement_does_not_count(proposals: Proposals) -> None:
    """The drone may still speak of the movement before."""
    mover = Mover()
    first = mover.start(proposals, 0.0, forward_m=0.3)
    second = mover.start(proposals, 0.1, forward_m=0.2)

    assert second.id != first.id
    assert mover.update(state(0.2, first.id, MovementState.DONE), 0.2) is Progress.RUNNING
    assert mover.proposal == second


@pytest.mark.parametrize(
    ("movement", "patience_s"),
    [({"forward_m": 0.3}, 7.0), ({"down_m": -0.5}, 9.0), ({"yaw_rad": -math.pi}, 19.7)],
)
def test_a_movement_that_is_never_acknowledged_fails(
    proposals: Proposals, movement: dict[str, float], patience_s: float
) -> None:
    """After as long as the slowest drone would take, and some grace."""
    mover = Mover()
    mover.start(proposals, 10.0, **movement)

    assert mover.update(state(0.0), 10.0 + patience_s - 0.1) is Progress.RUNNING
    assert mover.update(state(0.0), 10.0 + patience_s + 0.1) is Progress.FAILED


def test_dropping_ends_it_now(proposals: Proposals) -> None:
    """A dropped movement ends when it is dropped; dropping nothing changes nothing."""
    mover = Mover()
    mover.start(proposals, 0.0, forward_m=0.3)
    mover.drop(0.4)
    mover.drop(0.9)

    assert not mover.busy
    assert mover.ended_s == 0.4
