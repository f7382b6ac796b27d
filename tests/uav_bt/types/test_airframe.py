"""An airframe: sizes and reaction of a body; impossible values are refused."""

from __future__ import annotations

import math

import pytest

from uav_bt.errors import ValueRangeError
from uav_bt.types import Airframe


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"body_size_m": (0.2, 0.0, 0.1)}, "three positive sizes"),
        ({"body_size_m": (0.2, 0.3)}, "three positive sizes"),
        ({"climb_braking_mps2": 0.0}, "positive climb_braking_mps2"),
        ({"braking_mps2": 0.0}, "and braking_mps2"),
        ({"command_delay_s": -0.1}, "zero or positive seconds"),
        ({"command_lag_s": math.nan}, "zero or positive seconds"),
    ],
)
def test_impossible_numbers_are_refused(bad: dict[str, object], words: str) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Airframe(**bad)  # type: ignore[arg-type]
