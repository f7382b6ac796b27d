"""Take-off, landing and emergency stop."""

from __future__ import annotations

from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import Land


def test_a_flight_goes_through_the_firmwares_states(bench: Bench) -> None:
    bench.told.clear()
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(2.0)
    bench.send("ardrone3.Piloting.Landing")
    bench.run(2.0)
    assert bench.flying_states() == ["motor_ramping", "takingoff", "hovering", "landing", "landed"]


def test_a_landing_can_be_taken_back(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.SmartTakeOffLand")
    bench.run(0.2)
    assert isinstance(bench.world.orders[-1], Land)
    assert bench.flying_states() == ["landing"]


def test_an_emergency_cuts_the_motors_out(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.Emergency")
    assert bench.flying_states() == ["emergency"]
    bench.run(2.0)
    assert bench.flying_states() == ["emergency", "landed"]


def test_an_emergency_on_the_ground_is_told_too(bench: Bench) -> None:
    bench.told.clear()
    bench.send("ardrone3.Piloting.Emergency")
    bench.run(1.0)
    assert bench.flying_states() == ["emergency", "landed"]
