"""Numbers and horizontal vectors within bounds."""

from __future__ import annotations

import pytest

from uav_bt.types import clamp, limit_length


@pytest.mark.parametrize(("value", "bounded"), [(2.0, 1.5), (-2.0, -1.5), (0.3, 0.3)])
def test_a_number_is_bounded_both_ways(value: float, bounded: float) -> None:
    assert clamp(value, 1.5) == bounded


def test_a_vector_is_shortened_and_keeps_its_direction() -> None:
    assert limit_length(3.0, -4.0, 1.0) == pytest.approx((0.6, -0.8))
    assert limit_length(0.3, -0.4, 1.0) == (0.3, -0.4)
    assert limit_length(0.0, 0.0, 0.0) == (0.0, 0.0)
    assert limit_length(3.0, 4.0, 0.0) == (0.0, 0.0)
