"""Decisions of leaf policies check themselves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from uav_bt.errors import ValueRangeError
from uav_bt.protocols import Decision


@pytest.mark.parametrize("yaw_rad", [30.0, -90.0, math.nan, math.inf])
def test_a_turn_in_degrees_is_refused(yaw_rad: float) -> None:
    with pytest.raises(ValueRangeError, match=r"in radians, .*got .*write math\.radians"):
        Decision(yaw_rad=yaw_rad)


def test_an_advance_is_finite_and_a_full_turn_is_a_turn() -> None:
    with pytest.raises(ValueRangeError, match="forward_m must be finite, got inf"):
        Decision(forward_m=math.inf)
    assert Decision(yaw_rad=2.0 * math.pi).blocked


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"forward_m": "0.3"}, "forward_m of a Decision must be a number, got '0.3'"),
        ({"forward_m": True}, "forward_m of a Decision must be a number, got True"),
        ({"free_m": "all"}, "free_m of a Decision must be a number"),
        ({"yaw_rad": None}, "yaw_rad of a Decision must be a number, got None"),
        ({"done": "false"}, "done of a Decision must be True or False, got 'false'"),
        ({"speed_mps": 0.4}, "must say in forward_m how far the way ahead leads, got 0"),
    ],
)
def test_a_decision_of_other_values_is_refused(given: dict[str, Any], why: str) -> None:
    with pytest.raises(ValueRangeError, match=why):
        Decision(**given)


def test_numbers_of_numpy_are_numbers() -> None:
    assert Decision(forward_m=np.float32(0.3), done=np.bool_(False)).forward_m > 0.0  # type: ignore[arg-type]
