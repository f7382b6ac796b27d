"""A held landing hands over to the drone's landing at a height independent of its start."""

from __future__ import annotations

import pytest

from uav_bt.mission.hold_model import HeldLanding

TICK_S = 0.1


def descend(height_m: float, *, sinks: float = 1.0) -> tuple[float, float]:
    """Return height and time at the hand-over; the drone sinks by a share of the command."""
    landing, time_s = HeldLanding(height_m), 0.0
    while (down_mps := landing.order(height_m, TICK_S)) is not None:
        height_m -= sinks * down_mps * TICK_S
        time_s += TICK_S
        assert time_s < 60.0
    return height_m, time_s


@pytest.mark.parametrize("begin_m", [0.3, 0.6, 1.5, 3.0, 4.0, 8.0])
def test_it_hands_over_at_its_height(begin_m: float) -> None:
    assert descend(begin_m)[0] == pytest.approx(0.2, abs=0.045)


def test_speed_follows_the_height_within_its_bounds() -> None:
    """0.6 per second: 0.45 m/s from 0.75 m up, 0.3 m/s at 0.5 m, 0.2 m/s from 0.33 m down."""
    landing = HeldLanding(2.0)
    speeds = [landing.order(height_m, 0.0) for height_m in (2.0, 0.75, 0.5, 0.3, 0.2)]
    assert speeds == [0.45, pytest.approx(0.45), pytest.approx(0.3), 0.2, None]


@pytest.mark.parametrize(("begin_m", "after_s"), [(1.5, 5.0), (3.0, 10.0)])
def test_a_height_that_does_not_sink_ends_it_after_half_as_much_again(
    begin_m: float, after_s: float
) -> None:
    """1.5 times the height at 0.45 m/s."""
    height_m, time_s = descend(begin_m, sinks=0.0)
    assert height_m == begin_m
    assert time_s == pytest.approx(after_s, abs=2 * TICK_S)
