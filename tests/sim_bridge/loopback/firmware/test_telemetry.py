"""Periodic states."""

from __future__ import annotations

import math

import pytest

from tests.sim_bridge.loopback.loopback_world import Bench


def test_attitude_comes_five_times_a_second(bench: Bench) -> None:
    bench.run(1.0)
    bench.told.clear()
    bench.run(4.0)
    for name in ("AttitudeChanged", "SpeedChanged", "AltitudeChanged", "GpsLocationChanged"):
        assert 19 <= len(bench.values(f"ardrone3.PilotingState.{name}")) <= 21
    assert 19 <= len(bench.values("gimbal.attitude")) <= 21


def test_speed_is_told_north_east_down(bench: Bench) -> None:
    bench.fly()
    bench.send("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=math.pi / 2)
    bench.run(3.0)
    bench.told.clear()
    bench.send("ardrone3.Piloting.moveBy", dX=5.0, dY=0.0, dZ=0.0, dPsi=0.0)
    bench.run(1.0)
    speed = bench.values("ardrone3.PilotingState.SpeedChanged")[-1]
    assert speed == pytest.approx({"speedX": 0.0, "speedY": 1.0, "speedZ": 0.0}, abs=0.05)
