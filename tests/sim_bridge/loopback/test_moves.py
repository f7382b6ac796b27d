"""Relative movements, flights to a place on earth, and the return home."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench, Order, Step, full_name, move_by, sticks
from uav_bt.types import FlyingState

UP, DOWN = FlyingState.HOVERING, FlyingState.LANDED
SPEEDS = {"max_horizontal_speed": 0.2, "max_vertical_speed": 0.1, "max_yaw_rotation_speed": 0.0}
LOCATION = location(2.0, 2.0).arguments


def position(bench: Bench) -> tuple[float, float, float]:
    return bench.state.north_m, bench.state.east_m, bench.state.altitude_m


def slowly(d_x: float, **how: float) -> Order:
    return "extended_move_by", {"d_x": d_x, "d_y": 0.0, "d_z": 0.0, "d_psi": 0.0, **SPEEDS, **how}


def move_to(north_m: float, east_m: float, **how: Any) -> Order:
    place = location(north_m, east_m, 1.0).arguments
    return "moveTo", {**place, "orientation_mode": "NONE", "heading": 0.0, **how}


# --- relative movements ---------------------------------------------------------------------------


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
        *(
            (step, "interrupted", "CANCELED")
            for step in (
                move_by(dy=1.0),
                "Landing",
                "Emergency",
                "return_to_home",
                sticks(pitch=50),
            )
        ),
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
        (
            None,
            ["TakeOff", UP, slowly(1.0, d_psi=1.0), slowly(1.0, **dict.fromkeys(SPEEDS, 0.0))],
            2 * ["unknown"],
        ),
        (None, ["TakeOff", UP, slowly(1.0, max_horizontal_speed=math.nan)], ["unknown"]),
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
        [slowly(1.0)],
    ],
)
def test_a_movement_keeps_the_speeds_that_are_set(flown: Bench, steps: list[Step]) -> None:
    flown.play(*steps, 4.5)
    assert flown.values("moveByEnd") == []
    flown.run(2.0)
    assert flown.values("moveByEnd", "error") == ["ok"]


# --- places ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "heading_deg", "wanted_deg"),
    [
        ("NONE", 77.0, 0.0),
        ("TO_TARGET", 0.0, 90.0),
        ("HEADING_START", -45.0, -45.0),
        ("HEADING_DURING", 30.0, 30.0),
    ],
)
def test_a_place_is_flown_to_facing_as_asked(
    flown: Bench, mode: str, heading_deg: float, wanted_deg: float
) -> None:
    how = {"altitude": 2.0, "orientation_mode": mode, "heading": heading_deg}
    flown.play(move_to(0.0, 4.0, **how), 0.7)
    turning_first = abs(position(flown)[1]) < 0.02
    assert turning_first is (mode in ("TO_TARGET", "HEADING_START"))
    flown.sticks(0.5, pitch=-50)  # which do not interrupt it
    flown.run(10.0)
    assert position(flown) == pytest.approx((0.0, 4.0, 2.0), abs=0.1)
    assert math.degrees(flown.state.attitude.yaw_rad) == pytest.approx(wanted_deg, abs=2.0)
    assert flown.values("moveToChanged", "status") == ["RUNNING", "DONE"]


def test_an_extended_flight_to_a_place_can_be_replaced_and_called_off(flown: Bench) -> None:
    _, slow = move_to(10.0, 0.0, orientation_mode="none", **SPEEDS)
    flown.play(("extended_move_to", slow), 2.5)
    assert position(flown)[0] == pytest.approx(0.5, abs=0.1)
    flown.play(move_to(0.0, 10.0), 1.0, "Landing")
    assert flown.values("moveToChanged", "status") == ["RUNNING", "RUNNING", "CANCELED"]


def test_a_place_that_is_none_is_refused(flown: Bench) -> None:
    for where in ({"latitude": 1e305}, {"longitude": math.nan}, {"heading": math.inf}):
        flown.play(move_to(2.0, 0.0, **where))
    assert flown.values("moveToChanged", "status") == 3 * ["ERROR"]


def test_without_a_fix_there_are_no_places_and_no_return() -> None:
    bench = Bench("train-a")
    bench.play("common.Settings.AllSettings")
    assert bench.values("GPSFixStateChanged") == [{"fixed": 0}]
    bench.fly()
    bench.play(move_to(2.0, 0.0), "return_to_home", 1.0)
    assert bench.values("moveToChanged", "status") == ["ERROR"]
    assert bench.values("rth.state") == bench.values("rth.home_location") == []
    assert bench.values("GpsLocationChanged", "latitude")[-1] == 500.0


# --- the return home ------------------------------------------------------------------------------


def test_it_returns_home_lands_and_says_so(flown: Bench) -> None:
    flown.play(move_by(3.0, 2.0), 8.0)
    flown.events.clear()
    flown.play("return_to_home", DOWN, 0.1)
    assert [(one["state"], one["reason"]) for one in flown.values("rth.state")] == [
        ("in_progress", "user_request"),
        ("available", "finished"),
        ("unavailable", "disabled"),
    ]
    assert position(flown) == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert max(flown.values("AltitudeChanged", "altitude")) > 19.0


def test_the_way_home_can_be_called_off(flown: Bench) -> None:
    flown.play(move_by(3.0), 6.0, ("NavigateHome", {"start": 1}), 1.0, "rth.abort", 3.0)
    assert flown.values("NavigateHomeStateChanged", "state") == ["inProgress", "available"]
    assert flown.state.flying is UP


def test_home_may_be_somewhere_else_and_hovered_over(flown: Bench) -> None:
    flown.play(
        ("set_custom_location", LOCATION),
        ("set_custom_location", LOCATION | {"latitude": 1e305}),  # is refused
        ("set_ending_behavior", {"ending_behavior": "hovering"}),
        ("set_ending_hovering_altitude", {"altitude": 3.0}),
        *("return_to_home", 60.0),
    )
    assert position(flown) == pytest.approx((2.0, 2.0, 3.0), abs=0.1)
    assert flown.values("rth.home_type") == [{"type": "custom"}]
    assert flown.state.flying is UP


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
