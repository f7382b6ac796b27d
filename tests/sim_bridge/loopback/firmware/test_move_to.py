"""Flights to a point on earth."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import FlyingState

MOVE_TO = "ardrone3.PilotingState.moveToChanged"


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.fly()
    return bench


def move_to(bench: Bench, north_m: float, east_m: float, altitude_m: float, **how: Any) -> None:
    there = location(north_m, east_m)
    bench.send(
        "ardrone3.Piloting.moveTo",
        latitude=there.latitude_deg,
        longitude=there.longitude_deg,
        altitude=altitude_m,
        **({"orientation_mode": "NONE", "heading": 0.0} | how),
    )


def position(bench: Bench) -> tuple[float, float, float]:
    state = bench.world.state()
    return state.north_m, state.east_m, state.altitude_m


def test_a_place_is_flown_to_and_told(bench: Bench) -> None:
    move_to(bench, 3.0, -2.0, 2.0)
    bench.run(5.0)
    assert position(bench) == pytest.approx((3.0, -2.0, 2.0), abs=0.1)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["RUNNING", "DONE"]
    assert bench.world.state().attitude.yaw_rad == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("mode", "heading_deg", "wanted_deg"),
    [("TO_TARGET", 0.0, 90.0), ("HEADING_START", -45.0, -45.0), ("HEADING_DURING", 30.0, 30.0)],
)
def test_a_place_is_flown_to_facing_as_asked(
    bench: Bench, mode: str, heading_deg: float, wanted_deg: float
) -> None:
    move_to(bench, 0.0, 4.0, 1.0, orientation_mode=mode, heading=heading_deg)
    bench.run(0.3)
    turning_first = abs(position(bench)[1]) < 0.05
    assert turning_first is (mode != "HEADING_DURING")
    bench.run(8.0)
    assert position(bench)[1] == pytest.approx(4.0, abs=0.1)
    yaw = math.degrees(bench.world.state().attitude.yaw_rad)
    assert yaw == pytest.approx(wanted_deg, abs=2.0)


def test_a_place_can_be_called_off_and_replaced(bench: Bench) -> None:
    move_to(bench, 10.0, 0.0, 1.0)
    bench.run(1.0)
    move_to(bench, 0.0, 10.0, 1.0)
    bench.run(1.0)
    bench.send("ardrone3.Piloting.CancelMoveTo")
    bench.run(0.1)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["RUNNING", "RUNNING", "CANCELED"]
    assert bench.world.state().flying is FlyingState.HOVERING


def test_the_sticks_do_not_interrupt_a_place(bench: Bench) -> None:
    move_to(bench, 2.0, 0.0, 1.0)
    bench.send(
        "ardrone3.Piloting.PCMD", flag=1, roll=0, pitch=-50, yaw=0, gaz=0, timestampAndSeqNum=0
    )
    bench.run(4.0)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["RUNNING", "DONE"]
