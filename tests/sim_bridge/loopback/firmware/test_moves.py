"""Relative movements, and flights to a geographic position."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

import pytest

from sim_bridge.loopback.world import location
from tests.sim_bridge.loopback.loopback_world import Bench

END = "ardrone3.PilotingEvent.moveByEnd"


CHANGED = "ardrone3.PilotingState.moveByChanged"


STATE = "ardrone3.PilotingState.FlyingStateChanged"


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


def test_a_movement_is_reported_from_its_start_to_its_end(bench: Bench) -> None:
    move_by(bench, 1.0, -0.5, -0.25, math.pi / 2)
    bench.run(3.0)
    seen = [name for name in bench.names() if name in (END, CHANGED, STATE)]
    assert seen == [CHANGED, STATE, CHANGED, END, STATE]
    assert bench.flying_states() == ["flying", "hovering"]
    (end,) = bench.values(END)
    assert end.pop("error") == "ok"
    wanted = {"dX": 1.0, "dY": -0.5, "dZ": -0.25, "dPsi": math.pi / 2}
    assert end == pytest.approx(wanted, abs=0.05)


def test_offsets_are_reported_in_the_frame_in_which_the_movement_began(bench: Bench) -> None:
    move_by(bench, dpsi=math.pi / 2)
    bench.run(3.0)
    bench.events.clear()
    move_by(bench, 1.0)
    bench.run(3.0)
    assert position(bench) == pytest.approx((0.0, 1.0, 1.0), abs=0.05)
    assert bench.values(END)[0]["dX"] == pytest.approx(1.0, abs=0.05)


def test_a_turn_of_more_than_half_is_reported_as_such(bench: Bench) -> None:
    move_by(bench, dpsi=1.75 * math.pi)
    bench.run(8.0)
    assert bench.values(END)[0]["dPsi"] == pytest.approx(1.75 * math.pi, abs=0.05)


def test_a_new_movement_interrupts_the_old_one(bench: Bench) -> None:
    move_by(bench, 5.0)
    bench.run(2.0)
    move_by(bench, 0.0, 1.0)
    bench.run(3.0)
    first, second = bench.values(END)
    assert (first["error"], second["error"]) == ("interrupted", "ok")
    assert first["dX"] == pytest.approx(2.0, abs=0.1)
    assert [one["status"] for one in bench.values(CHANGED)] == [
        "RUNNING",
        "CANCELED",
        "RUNNING",
        "DONE",
    ]


@pytest.mark.parametrize(
    ("command", "values"),
    [
        ("ardrone3.Piloting.Landing", {}),
        ("ardrone3.Piloting.Emergency", {}),
        ("rth.return_to_home", {}),
        (
            "ardrone3.Piloting.PCMD",
            {"flag": 1, "roll": 0, "pitch": 50, "yaw": 0, "gaz": 0, "timestampAndSeqNum": 0},
        ),
    ],
)
def test_what_interrupts_a_movement(bench: Bench, command: str, values: dict[str, Any]) -> None:
    move_by(bench, 5.0)
    bench.run(1.0)
    bench.send(command, **values)
    assert [one["error"] for one in bench.values(END)] == ["interrupted"]


def test_centred_sticks_do_not_interrupt_a_movement(bench: Bench) -> None:
    move_by(bench, 1.0)
    for _ in range(100):
        bench.send(
            "ardrone3.Piloting.PCMD",
            flag=0,
            roll=0,
            pitch=0,
            yaw=0,
            gaz=0,
            timestampAndSeqNum=0,
        )
        bench.run(0.02)
    assert [one["error"] for one in bench.values(END)] == ["ok"]


def test_movements_on_the_ground_are_refused() -> None:
    bench = Bench()
    move_by(bench, 1.0)
    assert [one["error"] for one in bench.values(END)] == ["notAvailable"]
    bench.send("ardrone3.Piloting.TakeOff")
    bench.run(0.2)
    move_by(bench, 1.0)
    assert [one["error"] for one in bench.values(END)] == ["notAvailable", "busy"]


def test_a_movement_that_is_no_number_is_refused(bench: Bench) -> None:
    move_by(bench, math.nan)
    assert [one["error"] for one in bench.values(END)] == ["notAvailable"]


def test_a_movement_against_something_ends(bench: Bench) -> None:
    bench.world.stuck = True
    move_by(bench, 1.0)
    bench.run(5.0)
    (end,) = bench.values(END)
    assert end["error"] == "unknown"
    assert bench.flying_states()[-1] == "hovering"


def test_a_movement_keeps_below_the_greatest_altitude(bench: Bench) -> None:
    bench.send("ardrone3.PilotingSettings.MaxAltitude", current=2.0)
    move_by(bench, dz=-5.0)
    bench.run(6.0)
    assert position(bench)[2] == pytest.approx(2.0, abs=0.05)


MOVE_TO = "ardrone3.PilotingState.moveToChanged"


def move_to(bench: Bench, north_m: float, east_m: float, altitude_m: float, **how: Any) -> None:
    there = location(north_m, east_m)
    bench.send(
        "ardrone3.Piloting.moveTo",
        latitude=there.latitude_deg,
        longitude=there.longitude_deg,
        altitude=altitude_m,
        **({"orientation_mode": "NONE", "heading": 0.0} | how),
    )


def test_a_place_is_flown_to_and_reported(bench: Bench) -> None:
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


def test_a_place_can_be_replaced_and_called_off_by_a_landing(bench: Bench) -> None:
    move_to(bench, 10.0, 0.0, 1.0)
    bench.run(1.0)
    move_to(bench, 0.0, 10.0, 1.0)
    bench.run(1.0)
    bench.send("ardrone3.Piloting.Landing")
    bench.run(0.1)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["RUNNING", "RUNNING", "CANCELED"]


def test_without_a_fix_there_are_no_places() -> None:
    bench = Bench(gps=False)
    bench.fly()
    move_to(bench, 2.0, 0.0, 1.0)
    bench.run(1.0)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["ERROR"]
    assert position(bench)[:2] == pytest.approx((0.0, 0.0), abs=1e-6)


def test_the_sticks_do_not_interrupt_a_place(bench: Bench) -> None:
    move_to(bench, 2.0, 0.0, 1.0)
    bench.send(
        "ardrone3.Piloting.PCMD", flag=1, roll=0, pitch=-50, yaw=0, gaz=0, timestampAndSeqNum=0
    )
    bench.run(4.0)
    assert [one["status"] for one in bench.values(MOVE_TO)] == ["RUNNING", "DONE"]


@pytest.mark.parametrize(
    ("tilt_deg", "climb_mps", "rotation_degps", "wanted"),
    [(1.0, 0.4, 30.0, (0.312, 0.4, 0.524)), (40.0, 4.0, 200.0, (2.0, 1.0, 1.4))],
)
def test_a_movement_is_as_fast_as_the_settings_allow(
    bench: Bench,
    tilt_deg: float,
    climb_mps: float,
    rotation_degps: float,
    wanted: tuple[float, float, float],
) -> None:
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=tilt_deg)
    bench.send("ardrone3.SpeedSettings.MaxVerticalSpeed", current=climb_mps)
    bench.send("ardrone3.SpeedSettings.MaxRotationSpeed", current=rotation_degps)
    move_by(bench, 1.0)
    assert astuple(bench.world.pace) == pytest.approx(wanted, abs=1e-3)


SLOW = {"max_horizontal_speed": 0.2, "max_vertical_speed": 0.1, "max_yaw_rotation_speed": 0.0}


def test_an_extended_movement_keeps_its_own_speed(bench: Bench) -> None:
    bench.fly()
    bench.send("move.extended_move_by", d_x=1.0, d_y=0.0, d_z=0.0, d_psi=0.0, **SLOW)
    bench.run(2.5)
    assert position(bench)[0] == pytest.approx(0.5, abs=0.02)
    bench.run(3.0)
    assert bench.values(END)[-1]["error"] == "ok"


@pytest.mark.parametrize(
    "change", [{"d_psi": 1.0}, dict.fromkeys(SLOW, 0.0), {"max_horizontal_speed": math.nan}]
)
def test_a_speed_of_nothing_is_an_error(bench: Bench, change: dict[str, float]) -> None:
    bench.fly()
    asked = {"d_x": 1.0, "d_y": 0.0, "d_z": 0.0, "d_psi": 0.0, **SLOW, **change}
    bench.send("move.extended_move_by", **asked)
    bench.run(0.5)
    assert bench.values(END)[-1]["error"] == "unknown"
    assert position(bench)[0] == 0.0
