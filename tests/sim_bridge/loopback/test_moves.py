"""Relative movements, and what they cannot do; a flight to a place; the return when alone."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench, Order, Step, full_name, move_by, sticks
from uav_bt.types import FlyingState

UP, DOWN = FlyingState.HOVERING, FlyingState.LANDED
SPEEDS = {"max_horizontal_speed": 0.2, "max_vertical_speed": 0.1, "max_yaw_rotation_speed": 0.0}
SLOWLY = "extended_move_by", {"d_x": 1.0, "d_y": 0.0, "d_z": 0.0, "d_psi": 0.0, **SPEEDS}


def position(bench: Bench) -> tuple[float, float, float]:
    return bench.state.north_m, bench.state.east_m, bench.state.altitude_m


def move_to(north_m: float, east_m: float, **how: Any) -> Order:
    place = location(north_m, east_m, 1.0).arguments
    return "moveTo", {**place, "orientation_mode": "NONE", "heading": 0.0, **how}


def test_a_movement_is_reported_in_the_frame_of_its_start(flown: Bench) -> None:
    flown.play(move_by(1.0, -0.5, -0.25, 1.75 * math.pi), 12.0)
    end, changed, state = map(full_name, ("moveByEnd", "moveByChanged", "FlyingStateChanged"))
    seen = [name for name in flown.names() if name in (end, changed, state)]
    assert seen == [changed, state, changed, end, state]
    flown.play(move_by(1.0), 5.0)
    assert flown.flying_states() == 2 * ["flying", "hovering"]
    first, second = flown.values("moveByEnd")
    assert first.pop("error") == second.pop("error") == "ok"
    assert first == pytest.approx(move_by(1.0, -0.5, -0.25, 1.75 * math.pi)[1], abs=0.05)
    assert (second["dX"], second["dY"]) == pytest.approx((1.0, 0.0), abs=0.05)
    assert position(flown) == pytest.approx((1.707, -1.207, 1.25), abs=0.05)


@pytest.mark.parametrize(
    ("step", "error", "status"),
    [
        (move_by(dy=1.0), "interrupted", "CANCELED"),
        ("Landing", "interrupted", "CANCELED"),
        ("Emergency", "interrupted", "CANCELED"),
        (sticks(pitch=50), "interrupted", "CANCELED"),
        (sticks(flag=0, pitch=50), "ok", "DONE"),  # the sticks are centred
    ],
)
def test_what_interrupts_a_movement(flown: Bench, step: Step, error: str, status: str) -> None:
    flown.play(move_by(3.0), 1.0, step, 5.0)
    assert flown.values("moveByEnd", "error")[0] == error
    assert flown.values("moveByChanged", "status")[:2] == ["RUNNING", status]


@pytest.mark.parametrize(
    ("scene", "steps", "errors"),
    [
        (
            None,
            [move_by(1.0), "TakeOff", 0.2, move_by(1.0), UP, move_by(math.nan)],
            ["notAvailable", "busy", "notAvailable"],
        ),
        ("depot-val-a", ["TakeOff", UP, move_by(30.0), 40.0], ["unknown"]),  # to a wall
    ],
)
def test_a_movement_may_be_refused(scene: str | None, steps: list[Step], errors: list[str]) -> None:
    bench = Bench(scene)
    bench.play(*steps)
    assert bench.values("moveByEnd", "error") == errors
    assert bench.state.flying is UP


@pytest.mark.parametrize(
    "steps",
    [
        [("MaxTilt", {"current": 1.0}), move_by(1.56)],  # 0.312 m/s
        [("MaxVerticalSpeed", {"current": 0.2}), move_by(dz=-1.0)],
        [("MaxRotationSpeed", {"current": 18.0}), move_by(dpsi=math.pi / 2)],
        [SLOWLY],
    ],
)
def test_a_movement_keeps_the_speeds_that_are_set(flown: Bench, steps: list[Step]) -> None:
    flown.play(*steps, 4.5)
    assert flown.values("moveByEnd") == []
    flown.run(2.0)
    assert flown.values("moveByEnd", "error") == ["ok"]


@pytest.mark.parametrize(
    ("mode", "yaw_deg"),
    [("NONE", 30), ("TO_TARGET", 90), ("HEADING_START", -60), ("HEADING_DURING", -60)],
)
def test_a_place_is_flown_to_and_one_that_is_none_is_refused(
    flown: Bench, mode: str, yaw_deg: float
) -> None:
    nowhere = move_to(2.0, 0.0, latitude=math.nan), move_to(2.0, 0.0, heading=math.inf)
    there = move_to(0.0, 4.0, orientation_mode=mode, heading=-60.0)
    flown.play(move_by(dpsi=math.radians(30.0)), 3.0, *nowhere, there, 10.0)
    assert position(flown) == pytest.approx((0.0, 4.0, 1.0), abs=0.1)
    assert math.degrees(flown.state.attitude.yaw_rad) == pytest.approx(yaw_deg, abs=1.0)
    assert flown.values("moveToChanged", "status") == ["ERROR", "ERROR", "RUNNING", "DONE"]


def test_without_a_fix_there_are_no_places_and_no_return() -> None:
    bench = Bench("train-a")
    bench.play("common.Settings.AllSettings")
    assert bench.values("GPSFixStateChanged") == [{"fixed": 0}]
    bench.fly()
    bench.play(move_to(2.0, 0.0), "return_to_home", 1.0)
    assert bench.values("moveToChanged", "status") == ["ERROR"]
    assert bench.values("rth.state") == bench.values("rth.home_location") == []
    assert bench.values("GpsLocationChanged", "latitude")[-1] == 500.0


@pytest.mark.parametrize("comes_back", [True, False])
def test_a_drone_without_client_hovers_and_comes_home(flown: Bench, *, comes_back: bool) -> None:
    flown.send("rth.set_delay", delay=10)
    flown.sticks(4.0, pitch=50)
    flown.anafi.disconnected()
    flown.run(8.0)
    away_m = flown.state.north_m
    assert (flown.state.flying, away_m > 2.0) == (UP, True)
    if comes_back:
        flown.connect()
    flown.run(90.0)
    assert flown.state.flying is (UP if comes_back else DOWN)
    assert flown.state.north_m == pytest.approx(away_m if comes_back else 0.0, abs=0.1)
