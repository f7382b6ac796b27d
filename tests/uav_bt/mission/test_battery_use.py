"""The use of a battery: known after a while, never underestimated."""

from __future__ import annotations

import pytest

from uav_bt.mission.battery_use import BatteryUse


def flown(seconds: int, per_min: float, *, step: float) -> BatteryUse:
    """Return the use after a flight with a battery that reports in steps."""
    use = BatteryUse()
    for now_s in range(seconds + 1):
        left = 0.9 - per_min * now_s / 60.0
        use.update(now_s, round(left / step) * step if step else left, flying=True)
    return use


def test_at_first_nothing_is_known() -> None:
    assert flown(19, 0.04, step=0.0).per_min is None


@pytest.mark.parametrize("step", [0.0, 0.01])
@pytest.mark.parametrize("seconds", [25, 60, 400])
def test_it_is_overestimated_by_a_step_at_most(seconds: int, step: float) -> None:
    per_min = flown(seconds, 0.04, step=step).per_min
    assert per_min is not None
    assert 0.04 - 1e-9 <= per_min <= 0.04 + 60.0 * 0.021 / seconds


def test_the_next_flight_is_measured_anew_and_time_on_the_ground_does_not_count() -> None:
    use = flown(60, 0.04, step=0.0)
    first = use.per_min
    use.update(600.0, 0.8, flying=False)
    assert use.per_min == first
    use.update(700.0, 0.8, flying=True)
    use.update(760.0, 0.6, flying=True)
    assert use.per_min == pytest.approx(0.21)


def test_a_battery_that_reports_nothing_is_left_out() -> None:
    use = BatteryUse()
    use.update(0.0, 0.9, flying=True)
    use.update(50.0, None, flying=True)
    assert use.per_min is None
