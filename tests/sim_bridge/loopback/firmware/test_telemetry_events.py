"""Battery, alerts and periodic states."""

from __future__ import annotations

import math

import pytest

from sim_bridge.loopback.firmware.telemetry_events import BatteryOptions
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import FlyingState


def test_the_battery_drains_warns_and_lands() -> None:
    bench = Bench(battery=BatteryOptions(charge=0.23, life_s=100.0))
    bench.fly()
    bench.run(16.0)
    percents = [one["percent"] for one in bench.values("common.CommonState.BatteryStateChanged")]
    assert percents == sorted(percents, reverse=True)
    alerts = [one["state"] for one in bench.values("ardrone3.PilotingState.AlertStateChanged")]
    assert alerts == ["low_battery", "critical_battery"]
    levels = [
        (one["alert"], one["level"])
        for one in bench.values("battery.alert")
        if one["level"] != "none"
    ]
    assert levels == [("power_level", "warning"), ("power_level", "critical")]
    assert bench.flying_states()[-1] == "landed"


def test_an_empty_battery_does_not_take_off_and_a_new_one_does() -> None:
    bench = Bench(battery=BatteryOptions(charge=0.05))
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(1.0)
    assert bench.world.state().flying is FlyingState.LANDED
    full = Bench(battery=BatteryOptions(charge=0.11, life_s=50.0))
    full.fly()
    full.send("ardrone3.Piloting.Landing")
    full.run(3.0)
    assert full.anafi.battery.charge < 0.1
    full.anafi.disconnected()
    assert full.anafi.battery.charge == pytest.approx(0.11)


def test_attitude_comes_five_times_a_second(bench: Bench) -> None:
    bench.run(1.0)
    bench.events.clear()
    bench.run(4.0)
    for name in ("AttitudeChanged", "SpeedChanged", "AltitudeChanged", "GpsLocationChanged"):
        assert 19 <= len(bench.values(f"ardrone3.PilotingState.{name}")) <= 21
    assert 19 <= len(bench.values("gimbal.attitude")) <= 21


def test_speed_is_reported_north_east_down(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=math.pi / 2)
    bench.run(3.0)
    bench.events.clear()
    bench.send("ardrone3.Piloting.moveBy", dX=5.0, dY=0.0, dZ=0.0, dPsi=0.0)
    bench.run(1.0)
    speed = bench.values("ardrone3.PilotingState.SpeedChanged")[-1]
    assert speed == pytest.approx({"speedX": 0.0, "speedY": 1.0, "speedZ": 0.0}, abs=0.05)


def test_the_batterys_voltage_falls_with_its_charge() -> None:
    bench = Bench(battery=BatteryOptions(charge=1.0, life_s=100.0))
    bench.send("common.Common.AllStates")
    assert bench.values("battery.serial")[-1]["serial"]
    assert bench.values("battery.voltage")[-1]["voltage"] == 8700
    bench.fly()
    bench.run(50.0)
    volts = [one["voltage"] for one in bench.values("battery.voltage")]
    assert volts == sorted(volts, reverse=True)
    assert 7500 < volts[-1] < 7800
