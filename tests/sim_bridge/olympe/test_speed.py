"""Speed control by stick positions."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_bridge.olympe.speed import SpeedHolder, Sticks
from tests.sim_bridge.olympe.fake_olympe import config
from uav_bt.types import BodyVelocity, Velocity


@settings(deadline=None)  # the machine may be busy
@given(
    forward=st.floats(-5, 5),
    right=st.floats(-5, 5),
    down=st.floats(-5, 5),
    yaw=st.floats(-9, 9),
    measured=st.floats(-20, 20),
)
def test_sticks_stay_within_a_hundred_percent(
    forward: float, right: float, down: float, yaw: float, measured: float
) -> None:
    holder = SpeedHolder(config())
    order = holder.limited(
        Velocity(forward_mps=forward, right_mps=right, down_mps=down, yaw_rate_radps=yaw)
    )
    assert math.hypot(order.forward_mps, order.right_mps) <= 1.0 + 1e-9
    sticks = holder.sticks(order, BodyVelocity(forward_mps=measured), 0.0)
    assert max(map(abs, (sticks.roll, sticks.pitch, sticks.yaw, sticks.climb))) <= 100


def test_nothing_wanted_and_nothing_moving_is_centred() -> None:
    assert SpeedHolder(config()).sticks(Velocity(), BodyVelocity(), 0.0) == Sticks()


@pytest.mark.parametrize("plant", ["tilt", "speed"])
def test_a_speed_is_reached_whatever_the_sticks_mean(plant: str) -> None:
    """With a drone whose sticks command tilt, and with one whose sticks command speeds."""
    holder, speed_mps, step_s = SpeedHolder(config()), 0.0, 0.05
    for step in range(400):
        measured_mps = BodyVelocity(forward_mps=speed_mps)
        sticks = holder.sticks(Velocity(forward_mps=0.5), measured_mps, step * step_s)
        share = sticks.pitch / 100
        if plant == "tilt":
            pull_mps2 = 9.81 * math.tan(share * math.radians(10.0)) - 0.25 * speed_mps
        else:
            pull_mps2 = (share * 1.0 - speed_mps) / 0.3
        speed_mps += step_s * pull_mps2
    assert speed_mps == pytest.approx(0.5, abs=0.05)
