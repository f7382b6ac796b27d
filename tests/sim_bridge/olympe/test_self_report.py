"""Faults that a drone reports."""

from __future__ import annotations

from typing import Any

import pytest

from sim_bridge.olympe.self_report import SelfReport

GOOD: dict[str, dict[str, Any]] = {
    "ardrone3.PilotingState.HoveringWarning": {"no_gps_too_dark": 0, "no_gps_too_high": 0},
    "ardrone3.PilotingState.AlertStateChanged": {"state": "none"},
    "ardrone3.SettingsState.MotorErrorStateChanged": {"motorIds": 0, "motorError": "noError"},
    "common.CalibrationState.MagnetoCalibrationRequiredState": {"required": 0},
    "common.CommonState.SensorsStatesListChanged": {
        "sensorName": "vertical_camera",
        "sensorState": 1,
    },
    "camera.zoom_level": {"cam_id": 0, "level": 1.0},
    "gimbal.calibration_state": {"state": "ok", "gimbal_id": 0},
    "gimbal.alert": {"error": 0, "gimbal_id": 0},
    "alarms.takeoff_checklist": {"check": "gyro", "state": "off"},
    "alarms.alarms": {"type": "motor_cutout", "state": "off"},
}


def told(*changes: tuple[str, dict[str, Any]], return_home: bool | None = None) -> SelfReport:
    report = SelfReport(return_home=return_home)
    for name, args in [*GOOD.items(), *changes]:
        report.take(name, {**GOOD.get(name, {}), **args})
    return report


def test_a_drone_without_complaints_has_no_faults() -> None:
    assert told().faults == ()


@pytest.mark.parametrize(
    ("event", "args", "line"),
    [
        ("ardrone3.PilotingState.HoveringWarning", {"no_gps_too_dark": 1}, "light: too dark"),
        ("ardrone3.PilotingState.AlertStateChanged", {"state": "cut_out"}, "alert: cut out"),
        (
            "ardrone3.SettingsState.MotorErrorStateChanged",
            {"motorIds": 0b1010, "motorError": "errorMotorStalled"},
            "motor 2, 4: errorMotorStalled",
        ),
        (
            "common.CalibrationState.MagnetoCalibrationRequiredState",
            {"required": 1},
            "magnetometer: needs a calibration",
        ),
        (
            "common.CommonState.SensorsStatesListChanged",
            {"sensorState": 0},
            "vertical camera: does not work",
        ),
        ("camera.zoom_level", {"level": 1.5}, "camera: zoomed in, 1.5 times"),
        ("gimbal.calibration_state", {"state": "required"}, "gimbal: needs a calibration"),
        ("gimbal.alert", {"error": 4}, "gimbal: reports an error (4)"),
        ("alarms.takeoff_checklist", {"state": "on"}, "take-off checklist: gyro prevents"),
        ("alarms.alarms", {"state": "on"}, "alarm: motor cutout"),
    ],
)
def test_each_complaint_is_a_fault_until_it_is_withdrawn(
    event: str, args: dict[str, Any], line: str, caplog: pytest.LogCaptureFixture
) -> None:
    report = told((event, args))
    (fault,) = report.faults
    assert f"{fault.what}: {fault.found}".startswith(line)
    assert fault.remedy
    assert caplog.text.count(fault.found) == 1
    report.take(event, GOOD[event])
    assert report.faults == ()


@pytest.mark.parametrize(
    ("event", "args"),
    [
        ("common.CommonState.SensorsStatesListChanged", {"sensorName": "GPS", "sensorState": 0}),
        ("alarms.takeoff_checklist", {"check": "gps", "state": "on"}),
        ("ardrone3.PilotingState.AlertStateChanged", {"state": "low_battery"}),
        ("common.CalibrationState.MagnetoCalibrationRequiredState", {"required": 2}),
    ],
)
def test_what_does_not_matter_indoors_is_no_fault(event: str, args: dict[str, Any]) -> None:
    assert told((event, args)).faults == ()


def test_a_return_home_that_cannot_be_switched_off_is_a_fault() -> None:
    (fault,) = told(return_home=False).faults
    assert fault.what == "return home"
    assert told(("rth.auto_trigger_mode", {"mode": "on"}), return_home=False).faults == ()
    assert told(return_home=True).faults == ()
