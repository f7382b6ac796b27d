"""Ledger of movements and their end events."""

from __future__ import annotations

import pytest

from sim_bridge.olympe.moves import MoveLedger
from uav_bt.types import MoveBy, MovementState


def ledger_of(*moves: MoveBy) -> MoveLedger:
    ledger = MoveLedger()
    for move in moves:
        ledger.sent(move)
    return ledger


def state_of(ledger: MoveLedger) -> tuple[int, MovementState]:
    assert ledger.status is not None
    return ledger.status.id, ledger.status.state


def test_a_new_movement_interrupts_the_one_before() -> None:
    ledger = ledger_of(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("interrupted", (0.4, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.RUNNING)
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.5))
    assert state_of(ledger) == (2, MovementState.DONE)


def test_an_end_that_crossed_the_next_command_is_the_first_ones() -> None:
    ledger = ledger_of(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("ok", (1.0, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.RUNNING)


def test_a_lost_event_does_not_shift_the_later_ones() -> None:
    ledger = ledger_of(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.49))
    assert state_of(ledger) == (2, MovementState.DONE)
    assert not ledger.moving


@pytest.mark.parametrize("error", ["busy", "notAvailable", "unknown"])
def test_a_refusal_is_the_latest_ones(error: str) -> None:
    ledger = ledger_of(MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    ledger.ended(error, (0.0, 0.0, 0.0, 0.0))
    assert state_of(ledger) == (2, MovementState.REJECTED)


def test_an_end_of_nothing_says_nothing() -> None:
    ledger = MoveLedger()
    ledger.ended("ok", (0.0, 0.0, 0.0, 0.0))
    assert ledger.status is None
