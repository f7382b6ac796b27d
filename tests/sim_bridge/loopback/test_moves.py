"""Relative movements, flights to a place on earth, and the return home."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench
from uav_bt.types import FlyingState

END = "ardrone3.PilotingEvent.moveByEnd"
CHANGED = "ardrone3.PilotingState.moveByChanged"
STATE = "ardrone3.PilotingState.FlyingStateChanged"
MOVE_TO = "ardrone3.PilotingState.moveToChanged"
SLOW = {"max_horizontal_speed": 0.2, "max_vertical_speed": 0.1, "max_yaw_rotation_speed": 0.0}
STICKS = {"flag": 1, "roll": 0, "pitch": 50, "yaw": 0, "gaz": 0, "timestampAndSeqNum": 0}
ASIDE = {"dX": 0.0, "dY": 1.0, "dZ": 0.0, "dPsi": 0.0}


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.fly()
    return bench


def position(bench: Bench) -> tuple[float, float, float]:
    return bench.state.north_m, bench.state.east_m, bench.state.altitude_m


def move_to(bench: Bench, north_m: float, east_m: float, **how: Any) -> None:
    place = location(north_m, east_m, 1.0).arguments
    turn = {"orientation_mode": "NONE", "heading": 0.0}
    bench.send("ardrone3.Piloting.moveTo", **(place | turn | how))


def test_a_movement_is_reported_in_the_frame_of_its_start(bench: Bench) -> None:
    bench.move_by(1.0, -0.5, -0.25, 1.75 * math.pi)
    bench.run(12.0)
    seen = [name for name in bench.names() if name in (END, CHANGED, STATE)]
    assert seen == [CHANGED, STATE, CHANGED, END, STATE]
    bench.move_by(1.0)
    bench.run(5.0)
    assert bench.flying_states() == 2 * ["flying", "hovering"]
    first, second = bench.values(END)
    assert first.pop("error") == second.pop("error") == "ok"
    wanted = {"dX": 1.0, "dY": -0.5, "dZ": -0.25, "dPsi": 1.75 * math.pi}
    assert first == pytest.approx(wanted, abs=0.05)
    assert (second["dX"], second["dY"]) == pytest.approx((1.0, 0.0), abs=0.05)
    assert position(bench) == pytest.approx((1.707, -1.207, 1.25), abs=0.05)


@pytest.mark.parametrize(
    ("command", "values", "error"),
    [
        ("ardrone3.Piloting.moveBy", ASIDE, "interrupted"),
        ("ardrone3.Piloting.Landing", {}, "interrupted"),
        ("ardrone3.Piloting.Emergency", {}, "interrupted"),
        ("rth.return_to_home", {}, "interrupted"),
        ("ardrone3.Piloting.PCMD", STICKS, "interrupted"),
        ("ardrone3.Piloting.PCMD", STICKS | {"flag": 0}, "ok"),  # the sticks are centred
    ],
)
def test_what_interrupts_a_movement(
    bench: Bench, command: str, values: dict[str, Any], error: str
) -> None:
    bench.move_by(3.0)
    bench.run(1.0)
    bench.send(command, **values)
    bench.run(5.0)
    assert bench.values(END, "error")[0] == error
    status = {"ok": "DONE", "interrupted": "CANCELED"}[error]
    assert bench.values(CHANGED, "status")[:2] == ["RUNNING", status]


def test_movements_are_refused_on_the_ground_and_without_a_number() -> None:
    bench = Bench()
    bench.move_by(1.0)
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(0.2)
    bench.move_by(1.0)
    bench.run_until(FlyingState.HOVERING)
    bench.move_by(math.nan)
    assert bench.values(END, "error") == ["notAvailable", "busy", "notAvailable"]


def test_a_movement_against_a_wall_ends_with_an_error() -> None:
    bench = Bench("depot-val-a")
    bench.fly()
    bench.move_by(30.0)
    bench.run(40.0)
    assert bench.values(END, "error") == ["unknown"]
    assert bench.state.flying is FlyingState.HOVERING


@pytest.mark.parametrize(
    ("setting", "value", "move", "took_s"),
    [
        ("ardrone3.PilotingSettings.MaxTilt", 1.0, {"dx": 1.56}, 5.0),  # 0.312 m/s
        ("ardrone3.SpeedSettings.MaxVerticalSpeed", 0.2, {"dz": -1.0}, 5.0),
        ("ardrone3.SpeedSettings.MaxRotationSpeed", 18.0, {"dpsi": math.pi / 2}, 5.0),
    ],
)
def test_a_movement_is_as_fast_as_the_settings_allow(
    bench: Bench, setting: str, value: float, move: dict[str, float], took_s: float
) -> None:
    bench.send(setting, current=value)
    bench.move_by(**move)
    bench.run(took_s - 0.5)
    assert bench.values(END) == []
    bench.run(2.0)
    assert bench.values(END, "error") == ["ok"]


@pytest.mark.parametrize(
    ("change", "error", "north_m"),
    [
        ({}, "ok", 1.0),
        ({"d_psi": 1.0}, "unknown", 0.0),
        (dict.fromkeys(SLOW, 0.0), "unknown", 0.0),
        ({"max_horizontal_speed": math.nan}, "unknown", 0.0),
    ],
)
def test_an_extended_movement_keeps_its_own_speed_if_that_is_one(
    bench: Bench, change: dict[str, float], error: str, north_m: float
) -> None:
    asked = {"d_x": 1.0, "d_y": 0.0, "d_z": 0.0, "d_psi": 0.0, **SLOW, **change}
    bench.send("move.extended_move_by", **asked)
    bench.run(2.5)
    assert position(bench)[0] == pytest.approx(north_m / 2, abs=0.05)
    bench.run(5.0)
    assert bench.values(END, "error") == [error]


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
    bench: Bench, mode: str, heading_deg: float, wanted_deg: float
) -> None:
    move_to(bench, 0.0, 4.0, altitude=2.0, orientation_mode=mode, heading=heading_deg)
    bench.run(0.7)
    turning_first = abs(position(bench)[1]) < 0.02
    assert turning_first is (mode in ("TO_TARGET", "HEADING_START"))
    bench.sticks(0.5, pitch=-50)  # which do not interrupt it
    bench.run(10.0)
    assert position(bench) == pytest.approx((0.0, 4.0, 2.0), abs=0.1)
    assert math.degrees(bench.state.attitude.yaw_rad) == pytest.approx(wanted_deg, abs=2.0)
    assert bench.values(MOVE_TO, "status") == ["RUNNING", "DONE"]


def test_an_extended_flight_to_a_place_can_be_replaced_and_called_off(bench: Bench) -> None:
    how = SLOW | {"heading": 0.0, "orientation_mode": "none"}
    bench.send("move.extended_move_to", **location(10.0, 0.0, 1.0).arguments, **how)
    bench.run(2.5)
    assert position(bench)[0] == pytest.approx(0.5, abs=0.1)
    move_to(bench, 0.0, 10.0)
    bench.run(1.0)
    bench.send("ardrone3.Piloting.Landing")
    assert bench.values(MOVE_TO, "status") == ["RUNNING", "RUNNING", "CANCELED"]


@pytest.mark.parametrize(
    "where", [{"latitude": 1e305}, {"longitude": math.nan}, {"heading": math.inf}]
)
def test_a_place_that_is_none_is_refused(bench: Bench, where: dict[str, float]) -> None:
    move_to(bench, 2.0, 0.0, **where)
    assert bench.values(MOVE_TO, "status") == ["ERROR"]


def test_without_a_fix_there_are_no_places_and_no_return() -> None:
    bench = Bench("train-a")
    bench.send("common.Settings.AllSettings")
    assert bench.values("ardrone3.GPSSettingsState.GPSFixStateChanged") == [{"fixed": 0}]
    bench.fly()
    move_to(bench, 2.0, 0.0)
    bench.send("rth.return_to_home")
    bench.run(1.0)
    assert bench.values(MOVE_TO, "status") == ["ERROR"]
    assert bench.values("rth.state") == bench.values("rth.home_location") == []
    assert bench.values("ardrone3.PilotingState.GpsLocationChanged", "latitude")[-1] == 500.0


def test_it_returns_home_lands_and_says_so(bench: Bench) -> None:
    bench.move_by(3.0, 2.0)
    bench.run(8.0)
    bench.events.clear()
    bench.send("rth.return_to_home")
    bench.run_until(FlyingState.LANDED, 120.0)
    bench.run(0.1)
    assert [(one["state"], one["reason"]) for one in bench.values("rth.state")] == [
        ("in_progress", "user_request"),
        ("available", "finished"),
        ("unavailable", "disabled"),
    ]
    assert position(bench) == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert max(bench.values("ardrone3.PilotingState.AltitudeChanged", "altitude")) > 19.0


def test_the_way_home_can_be_called_off(bench: Bench) -> None:
    bench.move_by(3.0)
    bench.run(6.0)
    bench.send("ardrone3.Piloting.NavigateHome", start=1)
    bench.run(1.0)
    bench.send("rth.abort")
    bench.run(3.0)
    legacy = bench.values("ardrone3.PilotingState.NavigateHomeStateChanged", "state")
    assert legacy == ["inProgress", "available"]
    assert bench.state.flying is FlyingState.HOVERING


def test_home_may_be_somewhere_else_and_hovered_over(bench: Bench) -> None:
    there = location(2.0, 2.0).arguments
    bench.send("rth.set_custom_location", **there)
    bench.send("rth.set_custom_location", **(there | {"latitude": 1e305}))  # is refused
    bench.send("rth.set_ending_behavior", ending_behavior="hovering")
    bench.send("rth.set_ending_hovering_altitude", altitude=3.0)
    bench.send("rth.return_to_home")
    bench.run(60.0)
    assert position(bench) == pytest.approx((2.0, 2.0, 3.0), abs=0.1)
    assert bench.values("rth.home_type") == [{"type": "custom"}]
    assert bench.state.flying is FlyingState.HOVERING


@pytest.mark.parametrize("comes_back", [True, False])
def test_a_client_that_leaves_in_flight_leaves_a_hovering_drone_that_comes_home(
    bench: Bench, *, comes_back: bool
) -> None:
    bench.send("rth.set_delay", delay=10)
    bench.sticks(4.0, pitch=50)
    bench.anafi.disconnected()
    bench.run(8.0)
    assert bench.state.flying is FlyingState.HOVERING
    away_m = bench.state.north_m
    assert away_m > 2.0
    if comes_back:
        bench.connect()
    bench.run(90.0)
    assert bench.state.flying is (FlyingState.HOVERING if comes_back else FlyingState.LANDED)
    assert bench.state.north_m == pytest.approx(away_m if comes_back else 0.0, abs=0.1)
