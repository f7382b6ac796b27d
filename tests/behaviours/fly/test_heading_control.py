"""The heading controller: sign, limits, integral, reset."""

import math

import pytest

from behaviours.fly.heading_control import HeadingController, HeadingGains

TICK_S = 0.1


def test_the_first_answer_is_proportional_and_the_rate_is_limited() -> None:
    """Without a past there is neither integral nor derivative; clockwise is positive."""
    gains = HeadingGains(proportional=1.5, max_yaw_rate_radps=0.6)
    assert HeadingController(gains).update(0.2, 7.0) == pytest.approx(0.3, abs=1e-6)
    assert HeadingController(gains).update(-0.2, 7.0) == pytest.approx(-0.3, abs=1e-6)
    controller = HeadingController(gains)
    assert controller.update(math.pi, 0.0) == pytest.approx(0.6)
    assert controller.update(-math.pi, TICK_S) == pytest.approx(-0.6)


def test_the_integral_removes_a_steady_drift() -> None:
    controller, drift_radps = HeadingController(), 0.08
    bearing, bearings = 0.0, []
    for tick in range(600):
        rate = controller.update(bearing, TICK_S * tick)
        bearing += TICK_S * (drift_radps - rate)
        bearings.append(bearing)
    without = drift_radps / controller.gains.proportional
    assert max(bearings) > 0.5 * without
    assert abs(bearings[-1]) < 0.05 * without


def test_long_saturation_leaves_no_windup() -> None:
    controller = HeadingController()
    for tick in range(600):  # something keeps the drone from turning
        assert controller.update(2.5, TICK_S * tick) == pytest.approx(1.0)
    bearing, overshoot = 2.5, 0.0
    for tick in range(600, 700):
        bearing -= TICK_S * controller.update(bearing, TICK_S * tick)
        overshoot = max(overshoot, -bearing)
    assert abs(bearing) < math.radians(1)
    assert overshoot < math.radians(1)


def test_after_a_reset_it_answers_as_a_new_one_and_to_a_second_call_at_one_time_the_same() -> None:
    used, fresh = HeadingController(), HeadingController()
    for tick in range(50):
        used.update(0.15, 100.0 + TICK_S * tick)
    used.reset()
    for now_s, bearing in ((0.0, -0.1), (0.1, -0.05), (0.2, 0.02)):
        answer = used.update(bearing, now_s)
        assert answer == fresh.update(bearing, now_s)
    for now_s in (0.2, 0.15):
        assert used.update(0.5, now_s) == answer
