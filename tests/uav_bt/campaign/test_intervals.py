"""Wilson's interval against published values, and at its ends."""

from __future__ import annotations

import pytest

from uav_bt.campaign.intervals import wilson
from uav_bt.errors import ValueRangeError


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),  # Newcombe 1998, table I, method 3
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_it_agrees_with_newcombe(successes: int, trials: int, low: float, high: float) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_nothing_but_successes_is_no_certainty() -> None:
    low, high = wilson(100, 100)
    assert (round(low, 4), high) == (0.963, 1.0)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 2)])
def test_impossible_counts_are_refused(successes: int, trials: int) -> None:
    with pytest.raises(ValueRangeError, match="0 <= successes <= trials"):
        wilson(successes, trials)
