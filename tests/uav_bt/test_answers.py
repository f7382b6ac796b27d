"""Answers of leaf policies check their values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from uav_bt.answers import Advance, Answer, Blocked, FollowLeg, Rotate
from uav_bt.errors import ValueRangeError

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


@pytest.mark.parametrize(
    ("kind", "given", "why"),
    [
        (Advance, {"forward_m": "0.3"}, "forward_m of Advance must be positive.*, got '0.3'"),
        (Advance, {"forward_m": math.inf}, "forward_m of Advance must be .*finite.*, got inf"),
        (Advance, {"forward_m": 0.0}, "must be positive .* return Blocked, got 0.0"),
        (Advance, {"forward_m": 1.0, "free_m": "all"}, "free_m of Advance must be .*, got 'all'"),
        (Advance, {"forward_m": 1.0, "free_m": math.nan}, "must be zero or positive.*, got nan"),
        (FollowLeg, {"speed_mps": -0.1}, "must be finite, and zero or positive, got -0.1"),
        (FollowLeg, {"speed_mps": math.inf}, "must be finite, and zero or positive, got inf"),
        (Rotate, {"yaw_rad": None}, "yaw_rad of Rotate must be a turn in radians.*, got None"),
        (Rotate, {"yaw_rad": True}, "yaw_rad of Rotate must be a turn in radians.*, got True"),
        (Blocked, {"yaw_rad": 0.5, "ground_ends": "no"}, "must be True or False, got 'no'"),
    ],
)
def test_an_answer_of_other_values_is_refused(
    kind: Callable[..., Answer], given: dict[str, object], why: str
) -> None:
    with pytest.raises(ValueRangeError, match=why):
        kind(**given)
    numpys: dict[str, Any] = {"yaw_rad": np.float32(0.3), "ground_ends": np.bool_(True)}
    assert Blocked(**numpys).ground_ends
