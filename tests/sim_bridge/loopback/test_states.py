"""What the drone tells: states for newcomers, settings, gimbal, camera, telemetry."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.firmware.camera import CAMERA_SETTINGS
from sim_bridge.loopback.firmware.settings import SETTINGS, Setting
from sim_bridge.loopback.messages import message_table
from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()


def gimbal_to(bench: Bench, pitch: float, mode: str = "position", frame: str = "absolute") -> None:
    bench.send(
        "gimbal.set_target",
        gimbal_id=0,
        control_mode=mode,
        yaw_frame_of_reference="none",
        yaw=0.0,
        pitch_frame_of_reference=frame,
        pitch=pitch,
        roll_frame_of_reference="none",
        roll=0.0,
    )


def pitch_deg(bench: Bench) -> float:
    return math.degrees(bench.world.state().gimbal_pitch_rad)


def test_a_newcomer_is_told_all_states_then_all_settings(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    states = bench.names()
    assert states[-1] == "common.CommonState.AllStatesChanged"
    wanted = {
        "ardrone3.PilotingState.FlyingStateChanged",
        "ardrone3.PilotingState.AttitudeChanged",
        "common.CommonState.BatteryStateChanged",
        "gimbal.absolute_attitude_bounds",
        "gimbal.attitude",
        "battery.alert",
        "rth.state",
        "camera.camera_capabilities",
    }
    assert wanted <= set(states)
    bench.told.clear()
    bench.send("common.Settings.AllSettings")
    names = bench.names()
    assert names[-1] == "common.SettingsState.AllSettingsChanged"
    assert {
        "common.SettingsState.ProductNameChanged",
        "ardrone3.PilotingSettingsState.MaxTiltChanged",
        "ardrone3.GPSSettingsState.HomeChanged",
    } <= set(names)
    assert not set(names) & set(states)


def test_all_that_is_told_are_events(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    bench.send("common.Settings.AllSettings")
    assert all(one.type.event for one in bench.told)


@pytest.mark.parametrize("setting", [*SETTINGS, *CAMERA_SETTINGS], ids=lambda one: one.command)
def test_every_setting_is_a_command_and_an_event_that_answers(
    bench: Bench, setting: Setting
) -> None:
    command = message_table().named(setting.command)
    values: dict[str, Any] = {}
    for argument in command.arguments:
        told = next((told for told, given in setting.takes.items() if given == argument.name), "")
        values[argument.name] = setting.start.get(told, 0)
    bench.told.clear()
    bench.send(setting.command, **values)
    (answer,) = bench.values(setting.event)
    for told, given in setting.takes.items():
        assert answer[told] == pytest.approx(values[given]), told


@pytest.mark.parametrize(
    ("asked", "taken"), [(12.0, 12.0), (0.0, 5.0), (90.0, 40.0), (math.nan, 20.0)]
)
def test_settings_are_taken_within_their_bounds(bench: Bench, asked: float, taken: float) -> None:
    bench.told.clear()
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=asked)
    (answer,) = bench.values("ardrone3.PilotingSettingsState.MaxTiltChanged")
    assert answer == {"current": taken, "min": 5.0, "max": 40.0}


def test_a_reset_brings_the_first_settings_back(bench: Bench) -> None:
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
    bench.send("common.Settings.Reset")
    tilt = bench.values("ardrone3.PilotingSettingsState.MaxTiltChanged")
    assert [one["current"] for one in tilt] == [12.0, 20.0]
    assert bench.values("common.SettingsState.ResetChanged") == [{}]


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


def test_states_are_told_once_until_they_change(bench: Bench) -> None:
    bench.told.clear()
    bench.run(2.0)
    assert bench.flying_states() == []
    assert bench.values("common.CommonState.BatteryStateChanged") == []


@pytest.mark.parametrize(("asked", "taken"), [(-45.0, -45.0), (-120.0, -90.0), (95.0, 90.0)])
def test_the_gimbal_points_within_its_bounds(bench: Bench, asked: float, taken: float) -> None:
    gimbal_to(bench, asked)
    bench.run(0.3)
    assert pitch_deg(bench) == pytest.approx(taken)
    assert bench.values("gimbal.attitude")[-1]["pitch_absolute"] == pytest.approx(taken)


def test_the_gimbal_moves_at_a_speed_until_its_bound(bench: Bench) -> None:
    bench.send("gimbal.set_max_speed", gimbal_id=0, yaw=0.0, pitch=60.0, roll=0.0)
    gimbal_to(bench, -0.5, mode="velocity", frame="none")
    bench.run(1.0)
    assert pitch_deg(bench) == pytest.approx(-30.0, abs=1.0)
    bench.run(5.0)
    assert pitch_deg(bench) == pytest.approx(-90.0)
    gimbal_to(bench, 0.5, mode="velocity", frame="none")
    bench.run(1.0)
    gimbal_to(bench, 0.0, mode="velocity", frame="none")
    bench.run(1.0)
    assert pitch_deg(bench) == pytest.approx(-60.0, abs=1.0)


@pytest.mark.parametrize(("pitch", "frame"), [(math.nan, "absolute"), (-30.0, "none")])
def test_a_gimbal_target_that_is_none_changes_nothing(
    bench: Bench, pitch: float, frame: str
) -> None:
    gimbal_to(bench, -10.0)
    gimbal_to(bench, pitch, frame=frame)
    assert pitch_deg(bench) == pytest.approx(-10.0)


def test_a_photo_is_taken_and_saved(bench: Bench) -> None:
    bench.told.clear()
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == ["taking_photo", "photo_taken", "photo_saved"]
    assert [one["state"] for one in bench.values("camera.photo_state")] == ["active", "inactive"]


def test_a_recording_starts_and_stops(bench: Bench) -> None:
    bench.told.clear()
    bench.send("camera.stop_recording", cam_id=0)
    bench.send("camera.start_recording", cam_id=0)
    bench.send("camera.stop_recording", cam_id=0)
    results = [one["result"] for one in bench.values("camera.recording_progress")]
    assert results == ["error_bad_state", "started", "stopped"]


def test_a_command_that_is_not_simulated_changes_nothing(bench: Bench) -> None:
    bench.told.clear()
    bench.send("ardrone3.Animations.Flip", direction="front")
    assert bench.told == []
    assert bench.world.orders == []
