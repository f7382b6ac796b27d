"""Decisions of leaf policies check themselves."""

from __future__ import annotations

import math

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
