"""The heading controller: sign, limits, anti-windup, reset, bad input."""

from __future__ import annotations

import math

import pytest

from behaviours.fly.heading_control import HeadingController, HeadingGains
from uav_bt.errors import ValueRangeError

TICK_S = 0.1
# Slower than any profile of the twin: windup shows best on a sluggish drone.
DELAY_TICKS, LAG_S = 3, 0.15


def sluggish_turn(gains: HeadingGains, turn_rad: float) -> list[float]:
    """Return the headings of a sluggish drone, rad, at the ticks of 6 s after a wanted turn."""
    controller, keep = HeadingController(gains), math.exp(-TICK_S / LAG_S)
    yaw_rad, rate_radps, sent = 0.0, 0.0, [0.0] * DELAY_TICKS
    yaws = [yaw_rad]
    for tick in range(60):
        sent.append(controller.update(turn_rad - yaw_rad, TICK_S * tick))
        command = sent[-1 - DELAY_TICKS]
        # Exact for a first-order lag whose command is held for the tick.
        yaw_rad += TICK_S * command + LAG_S * (1.0 - keep) * (rate_radps - command)
        rate_radps = command + keep * (rate_radps - command)
        yaws.append(yaw_rad)
    return yaws


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turns_towards_the_target(side: float) -> None:
    """A target to the right gives a clockwise rate, one to the left the opposite."""
    controller = HeadingController()

    assert side * controller.update(side * 0.2, 0.0) > 0.0


def test_first_answer_is_proportional() -> None:
    """Without a past there is neither integral nor derivative."""
    gains = HeadingGains(proportional=1.5)

    assert HeadingController(gains).update(0.2, 7.0) == pytest.approx(0.3, abs=1e-6)


def test_rate_is_limited() -> None:
    """However far the target, the rate stays within the limit."""
    controller = HeadingController(HeadingGains(max_yaw_rate_radps=0.6))

    assert controller.update(math.pi, 0.0) == pytest.approx(0.6)
    assert controller.update(-math.pi, TICK_S) == pytest.approx(-0.6)


def test_integral_takes_out_a_steady_drift() -> None:
    """A target that keeps moving sideways is followed without a lasting error."""
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
    """Held at the limit for a minute, it stops at the target once it may turn."""
    controller = HeadingController()
    for tick in range(600):  # something keeps the drone from turning
        assert controller.update(2.5, TICK_S * tick) == pytest.approx(1.0)

    bearing, now_s = 2.5, 60.0
    overshoot = 0.0
    for _ in range(100):
        rate = controller.update(bearing, now_s)
        bearing -= TICK_S * rate
        now_s += TICK_S
        overshoot = max(overshoot, -bearing)

    assert abs(bearing) < math.radians(1)
    assert overshoot < math.radians(1)


def test_long_turn_does_not_overshoot_on_a_sluggish_drone() -> None:
    """A turn of 170 degrees ends less than 8 degrees past the target."""
    yaws = sluggish_turn(HeadingGains(), math.radians(170))

    assert math.degrees(max(yaws)) < 178
    assert math.degrees(yaws[-1]) == pytest.approx(170, abs=2)


def test_integral_everywhere_would_overshoot() -> None:
    """The integral's zone is what keeps the turn from overshooting: without it the turn does."""
    everywhere = HeadingGains(integral_zone_rad=math.pi)
    turn = math.radians(170)

    zoned, unzoned = (sluggish_turn(gains, turn) for gains in (HeadingGains(), everywhere))

    assert max(unzoned) > max(zoned) + math.radians(4)


def test_reset_forgets_the_past() -> None:
    """After a reset it answers as a new one, at an earlier time even."""
    used, fresh = HeadingController(), HeadingController()
    for tick in range(50):
        used.update(0.15, 100.0 + TICK_S * tick)
    used.reset()

    for now_s, bearing in ((0.0, -0.1), (0.1, -0.05), (0.2, 0.02)):
        assert used.update(bearing, now_s) == fresh.update(bearing, now_s)


def test_same_moment_same_answer() -> None:
    """Asked again before time has passed, it repeats itself instead of dividing by nothing."""
    controller = HeadingController()
    controller.update(0.1, 0.0)
    answer = controller.update(0.12, 0.1)

    assert controller.update(0.5, 0.1) == answer
    assert controller.update(0.5, 0.05) == answer


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_refuses_what_is_not_finite(bad: float) -> None:
    """A bearing or a time that is not finite is refused, and leaves no trace."""
    controller, untouched = HeadingController(), HeadingController()
    for each in (controller, untouched):
        each.update(0.1, 0.0)

    with pytest.raises(ValueRangeError, match="must be finite"):
        controller.update(bad, 0.1)
    with pytest.raises(ValueRangeError, match="must be finite"):
        controller.update(0.1, bad)

    assert controller.update(0.08, 0.1) == untouched.update(0.08, 0.1)


@pytest.mark.parametrize(
    "field", ["proportional", "integral", "derivative", "max_yaw_rate_radps", "integral_zone_rad"]
)
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_refuses_senseless_gains(field: str, value: float) -> None:
    """Negative or infinite gains and limits are refused on construction."""
    with pytest.raises(ValueRangeError, match=field):
        HeadingGains(**{field: value})
