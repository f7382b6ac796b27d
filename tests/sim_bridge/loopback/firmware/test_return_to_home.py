"""Return to home, on request and after a lost link."""

from __future__ import annotations

from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import FlyingState


def pcmd(bench: Bench, **percent: int) -> None:
    sticks: dict[str, Any] = dict.fromkeys(("roll", "pitch", "yaw", "gaz"), 0)
    bench.send("ardrone3.Piloting.PCMD", flag=1, timestampAndSeqNum=0, **(sticks | percent))


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.fly()
    return bench


def move_by(
    bench: Bench, dx: float = 0.0, dy: float = 0.0, dz: float = 0.0, dpsi: float = 0.0
) -> None:
    bench.send("ardrone3.Piloting.moveBy", dX=dx, dY=dy, dZ=dz, dPsi=dpsi)


def position(bench: Bench) -> tuple[float, float, float]:
    state = bench.world.state()
    return state.north_m, state.east_m, state.altitude_m


def test_a_client_that_leaves_in_flight_leaves_a_hovering_drone_that_comes_home(
    bench: Bench,
) -> None:
    bench.send("rth.set_delay", delay=10)
    for _ in range(200):
        pcmd(bench, pitch=50)
        bench.run(0.02)
    away = bench.world.state().north_m
    assert away > 2.0
    bench.anafi.disconnected()
    bench.run(5.0)
    assert bench.world.state().flying is FlyingState.HOVERING
    bench.run(60.0)
    assert bench.world.state().flying is FlyingState.LANDED
    assert bench.world.state().north_m == pytest.approx(0.0, abs=0.1)


def test_a_client_that_comes_back_in_time_keeps_the_drone_there(bench: Bench) -> None:
    bench.send("rth.set_delay", delay=10)
    bench.anafi.disconnected()
    bench.run(5.0)
    bench.connect()
    bench.run(20.0)
    assert bench.world.state().flying is FlyingState.HOVERING


def test_it_returns_home_lands_and_says_so(bench: Bench) -> None:
    move_by(bench, 3.0, 2.0)
    bench.run(5.0)
    bench.events.clear()
    bench.send("rth.return_to_home")
    bench.run(60.0)
    states = [(one["state"], one["reason"]) for one in bench.values("rth.state")]
    assert states == [
        ("in_progress", "user_request"),
        ("available", "finished"),
        ("unavailable", "disabled"),
    ]
    assert position(bench) == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert bench.flying_states()[-2:] == ["landing", "landed"]


def test_the_way_home_can_be_called_off(bench: Bench) -> None:
    move_by(bench, 3.0)
    bench.run(5.0)
    bench.events.clear()
    bench.send("ardrone3.Piloting.NavigateHome", start=1)
    bench.run(1.0)
    bench.send("rth.abort")
    bench.run(1.0)
    legacy = bench.values("ardrone3.PilotingState.NavigateHomeStateChanged")
    assert [(one["state"], one["reason"]) for one in legacy] == [
        ("inProgress", "userRequest"),
        ("available", "stopped"),
    ]
    assert bench.world.state().flying is FlyingState.HOVERING


def test_home_may_be_somewhere_else_and_hovered_over(bench: Bench) -> None:
    there = location(2.0, 2.0)
    bench.send(
        "rth.set_custom_location",
        latitude=there.latitude_deg,
        longitude=there.longitude_deg,
        altitude=0.0,
    )
    bench.send("rth.set_ending_behavior", ending_behavior="hovering")
    bench.send("rth.set_ending_hovering_altitude", altitude=3.0)
    bench.send("rth.return_to_home")
    bench.run(60.0)
    assert position(bench) == pytest.approx((2.0, 2.0, 3.0), abs=0.1)
    assert bench.values("rth.home_type")[-1] == {"type": "custom"}
    assert bench.world.state().flying is FlyingState.HOVERING
