"""Take-off, landing, emergency stop, and the sticks."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.firmware.piloting import EXPIRY_S
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import Hover, Land, Velocity


def test_a_flight_goes_through_the_firmwares_states(bench: Bench) -> None:
    bench.events.clear()
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(2.0)
    bench.send("ardrone3.Piloting.Landing")
    bench.run(2.0)
    assert bench.flying_states() == ["motor_ramping", "takingoff", "hovering", "landing", "landed"]


def test_a_landing_begins_at_once(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.Landing")
    bench.run(0.2)
    assert isinstance(bench.world.orders[-1], Land)
    assert bench.flying_states() == ["landing"]


def test_an_emergency_cuts_the_motors_out(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.Emergency")
    assert bench.flying_states() == ["emergency"]
    bench.run(2.0)
    assert bench.flying_states() == ["emergency", "landed"]


def test_an_emergency_on_the_ground_is_reported_too(bench: Bench) -> None:
    bench.events.clear()
    bench.send("ardrone3.Piloting.Emergency")
    bench.run(1.0)
    assert bench.flying_states() == ["emergency", "landed"]


def pcmd(bench: Bench, **percent: int) -> None:
    sticks: dict[str, Any] = dict.fromkeys(("roll", "pitch", "yaw", "gaz"), 0)
    bench.send("ardrone3.Piloting.PCMD", flag=1, timestampAndSeqNum=0, **(sticks | percent))


def test_the_sticks_fly_and_expire(bench: Bench) -> None:
    bench.fly()
    pcmd(bench, pitch=50)
    bench.run(EXPIRY_S / 2)
    assert isinstance(bench.world.orders[-1], Velocity)
    bench.run(EXPIRY_S)
    assert isinstance(bench.world.orders[-1], Hover)
    assert bench.flying_states() == ["flying", "hovering"]


def test_centred_sticks_stop_at_once(bench: Bench) -> None:
    bench.fly()
    pcmd(bench, pitch=50)
    bench.run(0.1)
    pcmd(bench)
    assert isinstance(bench.world.orders[-1], Hover)


def test_without_the_flag_roll_and_pitch_do_not_count(bench: Bench) -> None:
    bench.fly()
    bench.send(
        "ardrone3.Piloting.PCMD",
        flag=0,
        roll=50,
        pitch=50,
        yaw=10,
        gaz=0,
        timestampAndSeqNum=0,
    )
    order = bench.world.orders[-1]
    assert isinstance(order, Velocity)
    assert (order.forward_mps, order.right_mps) == (0.0, 0.0)
    assert order.yaw_rate_radps > 0.0


def held(bench: Bench, duration_s: float, **sticks: int) -> Velocity:
    """Hold the sticks for a time and return the commanded velocity at its end."""
    for _ in range(round(duration_s / 0.2)):
        pcmd(bench, **sticks)
        bench.run(0.2)
    order = bench.world.orders[-1]
    assert isinstance(order, Velocity)
    return order


def test_a_tilt_accelerates_until_drag_ends_it(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=5.0)
    after_a_second = held(bench, 1.0, pitch=100).forward_mps
    steady = held(bench, 20.0, pitch=100).forward_mps
    # Without drag, g tan(5 degrees) gives 0.86 m/s in a second.
    assert 0.55 < after_a_second < 0.86
    assert steady == pytest.approx(1.56, abs=0.01)


def test_sticks_are_shares_of_what_is_set(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=5.0)
    bench.send("ardrone3.SpeedSettings.MaxVerticalSpeed", current=0.4)
    bench.send("ardrone3.SpeedSettings.MaxRotationSpeed", current=30.0)
    order = held(bench, 20.0, pitch=100, gaz=50, yaw=-100)
    tilt = math.tan(math.radians(5.0)) / math.tan(math.radians(40.0))
    assert order.forward_mps == pytest.approx(15.0 * tilt, abs=1e-3)
    assert order.down_mps == pytest.approx(-0.2)
    assert order.yaw_rate_radps == pytest.approx(-math.radians(30.0))


def test_sticks_keep_within_what_the_body_can_do(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=40.0)
    order = held(bench, 20.0, pitch=100, roll=-100)
    assert math.hypot(order.forward_mps, order.right_mps) == pytest.approx(2.0, abs=1e-3)
    assert order.right_mps == pytest.approx(-order.forward_mps)


def test_the_greatest_altitude_is_kept(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.PilotingSettings.MaxAltitude", current=1.2)
    for _ in range(60):
        pcmd(bench, gaz=100)
        bench.run(0.02)
    assert bench.world.state().altitude_m == pytest.approx(1.2, abs=0.05)


def test_the_sticks_do_nothing_on_the_ground(bench: Bench) -> None:
    pcmd(bench, pitch=50)
    bench.run(0.1)
    assert bench.world.orders == []
