"""Answers of leaf policies check their values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.worlds.tables import cases
from uav_bt.answers import Advance, Answer, Blocked, FollowLeg, Rotate
from uav_bt.errors import ValueRangeError

CASES = cases("values")

KINDS: dict[str, Any] = {kind.__name__: kind for kind in (Advance, FollowLeg, Rotate, Blocked)}
TURNS: list[Callable[[float], Answer]] = [
    lambda yaw_rad: Advance(forward_m=0.3, yaw_rad=yaw_rad),
    lambda yaw_rad: FollowLeg(yaw_rad=yaw_rad, speed_mps=0.3),
    lambda yaw_rad: Rotate(yaw_rad=yaw_rad),
    lambda yaw_rad: Blocked(yaw_rad=yaw_rad),
]


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("yaw_rad", [30.0, -90.0, math.nan, math.inf])
def test_a_turn_in_degrees_is_refused(turn: Callable[[float], Answer], yaw_rad: float) -> None:
    with pytest.raises(ValueRangeError, match=r"in radians, .*write math\.radians.*, got "):
        turn(yaw_rad)
    turn(-2.0 * math.pi)


@pytest.mark.parametrize(("kind", "given", "why"), CASES["refused_answers"])
def test_an_answer_of_other_values_is_refused(
    kind: str, given: dict[str, object], why: str
) -> None:
    with pytest.raises(ValueRangeError, match=why):
        KINDS[kind](**given)
    numpys: dict[str, Any] = {"yaw_rad": np.float32(0.3), "ground_ends": np.bool_(True)}
    assert Blocked(**numpys).ground_ends


def test_numbers_of_a_network_are_compared_in_full() -> None:
    assert Advance(forward_m=np.float32(0.3)).forward_m == np.float32(0.3)
    for bad in (np.float32(0.0), np.float32(math.inf)):
        with pytest.raises(ValueRangeError, match="positive and finite"):
            Advance(forward_m=bad)
