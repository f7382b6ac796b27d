"""On which side of what stands before the helipad the way was tried."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.tried_sides import TriedSides
from uav_bt.types import HeldTurn


def stopped(*ranges_m: float, side: int = 1) -> TriedSides:
    """Return the memory of a drone that was stopped so far from the pad, time after time."""
    sides = TriedSides()
    for range_m in ranges_m:
        sides.stopped(range_m, side)
        side = -side  # the policy would go to and fro
    return sides


@pytest.mark.parametrize("side", [1, -1])
def test_the_first_side_is_the_policys(side: int) -> None:
    assert stopped(2.0, side=side).leaving() == HeldTurn(direction=side)


def test_a_side_is_kept_until_it_has_failed() -> None:
    directions = [stopped(*[2.0] * times).leaving().direction for times in range(1, 11)]
    assert directions == [1, 1, 1, 1, -1, -1, -1, -1, 1, 1]


def test_nearer_to_the_pad_it_is_another_obstacle() -> None:
    assert stopped(2.0, 1.6).leaving().direction == 1
    assert stopped(2.0, 2.0, 2.0, 1.5, side=1).leaving() == HeldTurn(direction=-1)


def test_after_detours_in_vain_the_policy_is_asked_as_after_a_full_turn() -> None:
    assert stopped(2.0, 2.0).facing() == HeldTurn()
    relieved = stopped(2.0, 2.0, 2.0)
    assert (relieved.facing().direction, relieved.facing().full_turns) == (0, 1)
    assert (relieved.leaving().direction, relieved.leaving().full_turns) == (1, 1)


def test_what_is_forgotten_is_begun_anew() -> None:
    sides = stopped(2.0, 2.0, 2.0)
    sides.forget()
    assert sides.facing() == HeldTurn()
    sides.stopped(3.0, -1)
    assert sides.leaving() == HeldTurn(direction=-1)
    assert math.isclose(sides.leaving().turned_rad, 0.0)
