"""States for new clients, settings, and what is not answered."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.codec import message_types
from sim_bridge.loopback.handshake import ANAFI
from tests.sim_bridge.loopback.loopback_world import Bench

SOURCE = "skyctrl.CoPilotingState.pilotingSource"
TILT = "ardrone3.PilotingSettingsState.MaxTiltChanged"
BATTERY = "common.CommonState.BatteryStateChanged"


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_newcomer_gets_all_states_then_all_settings(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    states = bench.names()
    assert states[-1] == "common.CommonState.AllStatesChanged"
    assert {"ardrone3.PilotingState.AttitudeChanged", BATTERY, "rth.state"} <= set(states)
    flags = bench.values("battery.alert", "list_flags")
    assert flags == [{"First"}, *[set()] * (len(flags) - 2), {"Last"}]
    assert bench.values("camera.photo_capabilities", "list_flags") == [{"First", "Last"}]
    bench.events.clear()
    bench.send("common.Settings.AllSettings")
    settings = bench.names()
    assert settings[-1] == "common.SettingsState.AllSettingsChanged"
    assert {TILT, "ardrone3.GPSSettingsState.HomeChanged"} <= set(settings)
    assert not set(settings) & set(states)
    assert all(message_types()[name].event for name in states + settings)
    serial = [
        bench.values(f"common.SettingsState.ProductSerial{half}Changed", half.lower())[0]
        for half in ("High", "Low")
    ]
    assert "".join(serial) == ANAFI.serial


def test_states_are_sent_once_until_they_change(bench: Bench) -> None:
    bench.run(2.0)
    assert bench.flying_states() == bench.values(BATTERY) == []


@pytest.mark.parametrize(
    ("command", "values", "event", "answer"),
    [
        ("ardrone3.PilotingSettings.MaxTilt", {"current": 12.0}, TILT, {"current": 12.0}),
        ("ardrone3.PilotingSettings.MaxTilt", {"current": 0.0}, TILT, {"current": 1.0}),
        ("ardrone3.PilotingSettings.MaxTilt", {"current": 90.0}, TILT, {"current": 40.0}),
        ("ardrone3.PilotingSettings.MaxTilt", {"current": math.nan}, TILT, {"current": 20.0}),
        ("rth.set_delay", {"delay": 500}, "rth.delay", {"delay": 120}),
        ("rth.set_min_altitude", {"altitude": 25.0}, "rth.min_altitude", {"current": 25.0}),
        (
            "ardrone3.PilotingSettings.SetMotionDetectionMode",
            {"enable": 0},
            "ardrone3.PilotingSettingsState.MotionDetection",
            {"enabled": 0},
        ),
        (
            "gimbal.set_max_speed",
            {"gimbal_id": 0, "yaw": 9.0, "pitch": 500.0, "roll": 0.0},
            "gimbal.max_speed",
            {"current_pitch": 180.0, "current_yaw": 0.0},
        ),
        (
            "camera.set_style_params",
            {"cam_id": 0, "saturation": 9, "contrast": 1, "sharpness": 0},
            "camera.style",
            {"saturation": 2, "contrast": 1},
        ),
    ],
)
def test_a_setting_is_taken_within_its_bounds_and_answered(
    bench: Bench, command: str, values: dict[str, Any], event: str, answer: dict[str, Any]
) -> None:
    bench.send(command, **values)
    (sent,) = bench.values(event)
    assert {name: sent[name] for name in answer} == answer


def test_a_reset_brings_the_first_settings_back(bench: Bench) -> None:
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
    bench.send("common.Settings.ProductName", name="mine")
    bench.send("common.Settings.Reset")
    assert bench.values(TILT, "current") == [12.0, 20.0]
    names = bench.values("common.SettingsState.ProductNameChanged", "name")
    assert names == ["mine", ANAFI.name]
    assert bench.values("common.SettingsState.ResetChanged") == [{}]


@pytest.mark.parametrize(
    ("command", "values"),
    [
        ("camera.set_camera_mode", {"cam_id": 1, "value": "photo"}),
        ("camera.take_photo", {"cam_id": 1}),
        ("gimbal.reset_orientation", {"gimbal_id": 1}),
    ],
)
def test_a_command_of_another_camera_or_gimbal_changes_nothing(
    bench: Bench, command: str, values: dict[str, Any]
) -> None:
    bench.world.point(-0.5)
    bench.send(command, **values)
    assert bench.events == []
    bench.run(1.0)
    assert bench.state.gimbal_pitch_rad == pytest.approx(-0.5, abs=0.01)


@pytest.mark.parametrize(
    ("command", "values"),
    [
        ("ardrone3.Animations.Flip", {"direction": "front"}),
        ("ardrone3.Piloting.CancelMoveBy", {}),
        ("camera.set_zoom_target", {"cam_id": 0, "control_mode": "level", "target": 2.0}),
        ("camera.start_recording", {"cam_id": 0}),
        ("gimbal.set_offsets", {"gimbal_id": 0, "yaw": 0.0, "pitch": 0.0, "roll": 0.0}),
        ("user_storage.format", {"label": "card"}),
    ],
)
def test_what_is_not_answered_changes_nothing_and_is_named_once(
    bench: Bench, command: str, values: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(3):
        bench.send(command, **values)
    assert bench.events == []
    (line,) = caplog.messages
    assert line.startswith(f"{command} is not answered by the loopback")


def test_a_remote_control_says_that_it_has_a_drone_and_forwards_the_rest() -> None:
    remote = Bench(remote=True)
    remote.send("skyctrl.Common.AllStates")
    remote.send("skyctrl.Settings.AllSettings")
    assert remote.names()[-1] == "skyctrl.SettingsState.AllSettingsChanged"
    (link,) = remote.values("drone_manager.connection_state")
    assert (link["state"], link["serial"]) == ("connected", ANAFI.serial)
    assert not [name for name in remote.names() if name.startswith(("ardrone3", "common"))]
    remote.send("common.Common.AllStates")
    assert "ardrone3.PilotingState.FlyingStateChanged" in remote.names()
    remote.send("mapper.grab", buttons=3, axes=1)
    assert remote.values("mapper.grab_state")[1] == {"buttons": 3, "axes": 1, "buttons_state": 0}
    remote.events.clear()
    remote.run(1.0)
    assert len(remote.values("skyctrl.SkyControllerState.AttitudeChanged")) in range(15, 21)


def test_a_clients_sticks_count_only_while_it_has_them() -> None:
    remote = Bench(remote=True)
    remote.fly()
    remote.sticks(1.0, pitch=50)
    assert remote.state.north_m == pytest.approx(0.0, abs=1e-3)
    remote.send("skyctrl.CoPiloting.setPilotingSource", source="Controller")
    remote.sticks(1.0, pitch=50)
    assert remote.state.north_m > 0.1
    remote.firmware.disconnected()
    remote.connect()
    remote.send("skyctrl.Common.AllStates")
    assert remote.values(SOURCE, "source") == ["Controller", "SkyController"]
