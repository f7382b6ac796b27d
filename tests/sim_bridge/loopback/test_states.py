"""States for new clients, settings, what is not answered, and reports of all parts."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.codec import Message, message_types
from sim_bridge.loopback.media import Card, Photo
from sim_bridge.loopback.world import GROUND_M, HOME
from sim_bridge.olympe.orders import point
from tests.sim_bridge.loopback.loopback_world import Bench, Order, full_name, move_by
from uav_bt.types import FlyingState


def test_a_newcomer_gets_all_states_then_all_settings(bench: Bench) -> None:
    bench.play("common.Common.AllStates")
    states = bench.names()
    assert states[-1] == "common.CommonState.AllStatesChanged"
    wanted = {"PilotingState.AttitudeChanged", "BatteryStateChanged", "rth.state"}
    assert set(map(full_name, wanted)) <= set(states)
    flags = bench.values("battery.alert", "list_flags")
    assert flags == [{"First"}, *[set()] * (len(flags) - 2), {"Last"}]
    assert bench.values("photo_capabilities", "list_flags") == [{"First", "Last"}]
    bench.events.clear()
    bench.play("common.Settings.AllSettings")
    settings = bench.names()
    assert settings[-1] == "common.SettingsState.AllSettingsChanged"
    assert {full_name("MaxTiltChanged"), full_name("HomeChanged")} <= set(settings)
    assert not set(settings) & set(states)
    assert all(message_types()[name].event for name in states + settings)


def test_states_are_sent_once_until_they_change(bench: Bench) -> None:
    bench.run(2.0)
    assert bench.flying_states() == bench.values("BatteryStateChanged") == []


@pytest.mark.parametrize(
    ("command", "values", "event", "answer"),
    [
        ("MaxTilt", {"current": 0.0}, "MaxTiltChanged", {"current": 1.0}),
        ("MaxTilt", {"current": 90.0}, "MaxTiltChanged", {"current": 40.0}),
        ("MaxTilt", {"current": math.nan}, "MaxTiltChanged", {"current": 20.0}),
        ("rth.set_delay", {"delay": 500}, "rth.delay", {"delay": 120}),
    ],
)
def test_a_setting_is_taken_within_its_bounds_and_answered(
    bench: Bench, command: str, values: dict[str, Any], event: str, answer: dict[str, Any]
) -> None:
    bench.send(command, **values)
    (sent,) = bench.values(event)
    assert {name: sent[name] for name in answer} == answer


def test_a_reset_brings_the_first_settings_back(bench: Bench) -> None:
    bench.play(("MaxTilt", {"current": 12.0}), "common.Settings.Reset")
    assert bench.values("MaxTiltChanged", "current") == [12.0, 20.0]
    assert bench.values("common.SettingsState.ResetChanged") == [{}]


@pytest.mark.parametrize(
    ("command", "named"),
    [
        # Commands of another camera or gimbal.
        (("camera.set_camera_mode", {"cam_id": 1, "value": "photo"}), 0),
        (("camera.take_photo", {"cam_id": 1}), 0),
        # What the loopback lacks.
        (("ardrone3.Animations.Flip", {"direction": "front"}), 1),
        (("ardrone3.Piloting.CancelMoveBy", {}), 1),
        (("camera.start_recording", {"cam_id": 0}), 1),
    ],
)
def test_what_is_not_answered_changes_nothing_and_is_named_once(
    bench: Bench, caplog: pytest.LogCaptureFixture, command: Order, named: int
) -> None:
    name, values = command
    bench.world.point(-0.5)
    for _ in range(3):
        bench.firmware.handle(Message(name=name, values=values))
    assert bench.events == []
    lines = [line.partition(" is not answered by the loopback")[0] for line in caplog.messages]
    assert lines == [name] * named
    bench.run(1.0)
    assert bench.state.gimbal_pitch_rad == pytest.approx(-0.5, abs=0.01)


def test_a_clients_sticks_count_only_while_it_has_them() -> None:
    remote = Bench(remote=True)
    remote.fly()
    remote.sticks(1.0, pitch=50)
    assert remote.state.north_m == pytest.approx(0.0, abs=1e-3)
    remote.send("setPilotingSource", source="Controller")
    remote.sticks(1.0, pitch=50)
    assert remote.state.north_m > 0.1
    remote.firmware.disconnected()
    remote.connect()
    remote.play("skyctrl.Common.AllStates")
    assert remote.values("pilotingSource", "source") == ["Controller", "SkyController"]


@pytest.mark.parametrize(
    ("pitch_deg", "how", "seen_deg"),
    [
        (-45.0, {"pitch_frame_of_reference": "relative"}, -45.0),
        (-120.0, {}, -90.0),
        (95.0, {}, 90.0),
        (math.nan, {}, -10.0),
        (-30.0, {"pitch_frame_of_reference": "none"}, -10.0),
        (-0.5, {"control_mode": "velocity"}, -10.0),
    ],
)
def test_the_gimbal_points_within_its_bounds(
    bench: Bench, pitch_deg: float, how: dict[str, str], seen_deg: float
) -> None:
    name, level = point(0.0)
    bench.play((name, level | {"pitch": -10.0}), (name, level | {"pitch": pitch_deg} | how), 2.0)
    assert math.degrees(bench.state.gimbal_pitch_rad) == pytest.approx(seen_deg, abs=0.5)
    assert bench.values("gimbal.attitude", "pitch_absolute")[-1] == pytest.approx(seen_deg, abs=0.5)
    bench.play(("gimbal.reset_orientation", {"gimbal_id": 0}), 2.0)
    assert bench.state.gimbal_pitch_rad == pytest.approx(0.0, abs=0.01)


SHOOT = "camera.take_photo", {"cam_id": 0}


def test_a_photograph_is_taken_saved_and_counted(bench: Bench) -> None:
    bench.play(SHOOT, SHOOT)
    bench.photo.set_result(Photo(jpeg=b"j", thumbnail=b"t", size_px=(640, 360), taken_utc_s=9.0))
    bench.run(0.4)
    assert len(bench.media) == 0  # a real one takes longer
    bench.run(0.2)
    results = ["taking_photo", "error_bad_state", "photo_taken", "photo_saved"]
    assert bench.values("photo_progress", "result") == results
    assert bench.values("photo_state", "state") == ["active", "inactive"]
    assert bench.values("mediastore.counters", "photo_media_count") == [1]
    assert bench.values("photo_progress", "media_id")[-1] in bench.media.media


@pytest.mark.parametrize(
    ("card", "results", "state"),
    [
        (Card.READY, ["taking_photo", "error"], ("available", "ready")),
        (Card.FULL, ["error_no_storage_space"], ("available", "ready")),
        (Card.ABSENT, ["error_no_storage_space"], ("undetected", "unknown")),
    ],
)
def test_a_photograph_that_fails(card: Card, results: list[str], state: tuple[str, str]) -> None:
    bench = Bench(card=card)
    bench.photo.set_exception(OSError("dark"))
    bench.play("common.Common.AllStates", SHOOT, 1.0)
    assert bench.values("photo_progress", "result") == results
    (reported,) = bench.values("user_storage.state")
    assert (reported["physical_state"], reported["file_system_state"]) == state
    assert len(bench.media) == 0


def test_the_battery_drains_warns_and_lands() -> None:
    bench = Bench(charge=0.21)
    bench.fly()
    bench.run(180.0)
    percents = bench.values("BatteryStateChanged", "percent")
    assert percents == sorted(percents, reverse=True)
    assert bench.values("AlertStateChanged", "state") == ["low_battery", "critical_battery"]
    levels = [(one["alert"], one["level"]) for one in bench.values("battery.alert")]
    alerts = [("power_level", "warning"), ("power_level", "critical")]
    assert [one for one in levels if one[1] != "none"] == alerts
    assert bench.state.flying is FlyingState.LANDED
    bench.play("TakeOff", 1.0)
    assert bench.state.flying is FlyingState.LANDED
    bench.anafi.disconnected()  # on the ground its battery is changed
    bench.play("TakeOff", FlyingState.HOVERING)


def test_telemetry_comes_five_times_a_second(bench: Bench) -> None:
    bench.run(1.0)
    bench.events.clear()
    bench.run(4.0)
    piloting = ("AttitudeChanged", "SpeedChanged", "AltitudeChanged", "GpsLocationChanged")
    for name in ("gimbal.attitude", *(f"PilotingState.{name}" for name in piloting)):
        assert 19 <= len(bench.values(name)) <= 21


def test_speed_is_reported_north_east_down_and_positions_above_sea_level(bench: Bench) -> None:
    bench.fly()
    bench.play(move_by(dpsi=math.pi / 2), 5.0, move_by(5.0), 2.5)
    speed = bench.values("SpeedChanged")[-1]
    assert speed["speedY"] > 0.5
    assert (speed["speedX"], speed["speedZ"]) == pytest.approx((0.0, 0.0), abs=0.05)
    place = bench.values("GpsLocationChanged")[-1]
    assert place["altitude"] == pytest.approx(GROUND_M + bench.state.altitude_m, abs=0.05)
    assert place["latitude"] == pytest.approx(HOME.latitude_deg, abs=1e-6)
    assert place["longitude"] > HOME.longitude_deg
