"""Settings of the drone, changed for a flight and restored after it; faults that it reports."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from sim_bridge.olympe import settings
from sim_bridge.olympe.self_report import SelfReport
from tests.sim_bridge.olympe.fake_olympe import (
    BANKED_TURN,
    MAX_ALTITUDE,
    MAX_TILT,
    PATIENCE_S,
    RETURN_HOME,
    SETTINGS,
    STATE,
    FakeWorld,
    Flight,
)
from uav_bt.types import TakeOff


def test_former_values_are_restored_where_the_flight_changed_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", PATIENCE_S)
    event, _, former_tilt = SETTINGS[MAX_TILT]
    late = threading.Timer(0.05, lambda: world.made[0].event(event, current=former_tilt))
    world = FakeWorld(firmware="1.8.2", unreported={MAX_TILT}, on_connect=lambda _: late.start())
    flight = Flight(world, altitude_limit_m=30.0, return_home=False)
    flight.play(TakeOff())
    sent = dict(flight.sdk.sent)
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}
    assert (sent[BANKED_TURN], sent[RETURN_HOME]) == ({"value": 0}, {"mode": "off"})
    flight.sdk.sent.clear()
    flight.drone.disconnect()
    former = [(name, old) for name, (_, _, old) in SETTINGS.items() if name != MAX_ALTITUDE]
    assert [(name, *args.values()) for name, args in flight.sdk.sent] == former


def test_an_unconfirmed_limit_is_a_warning_once(caplog: pytest.LogCaptureFixture) -> None:
    # Some firmware lacks banked turns.
    flight = Flight(FakeWorld(firmware="1.8.2", refused={MAX_TILT, BANKED_TURN}))
    assert flight.play(TakeOff())[-1] == "TakeOff"  # nothing waits for an answer
    warnings = []
    for pause_s in (1.9, 0.2, 0.2):
        flight.play(pause_s)
        flight.drone.observe()
        warnings.append(len(caplog.messages))
    assert warnings == [0, 1, 1]
    assert f"does not confirm {MAX_TILT} = 10.0 (it reports 20.0) within 2 s" in caplog.text


ALL = "MaxTilt, MaxAltitude, MaxVerticalSpeed, MaxRotationSpeed"


@pytest.mark.parametrize(
    ("world", "gone", "line"),
    [
        (FakeWorld(unreported={MAX_TILT, MAX_ALTITUDE}), False, "MaxTilt, MaxAltitude: check them"),
        # Firmware without banked turns is not warned of.
        (FakeWorld(unreported={BANKED_TURN}, refused={BANKED_TURN}), True, f"{ALL}: check them"),
        (FakeWorld(), True, f"{ALL}, BankedTurn: check them"),
        (FakeWorld(refused={MAX_TILT}), False, f"{MAX_TILT} = 20.0 (it reports None)"),
    ],
)
def test_settings_that_cannot_be_restored_are_named(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    world: FakeWorld,
    line: str,
    *,
    gone: bool,
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", 0.01)
    flight = Flight(world)
    flight.play(TakeOff())
    flight.sdk.sent.clear()
    flight.sdk.connected = not gone
    flight.drone.disconnect()
    assert line in caplog.text
    restored = {name for name, _ in flight.sdk.sent}
    assert restored == (set() if gone else set(SETTINGS) - world.unreported - {RETURN_HOME})


SENSORS, CHECKLIST = "common.CommonState.SensorsStatesListChanged", "alarms.takeoff_checklist"
ALERT, MOTORS = f"{STATE}.AlertStateChanged", "ardrone3.SettingsState.MotorErrorStateChanged"
COMPASS = "common.CalibrationState.MagnetoCalibrationRequiredState"
OTHER = {"sensorName": "vertical_camera", "check": "gyro", "type": "motor_cutout", "motorIds": 10}


@pytest.mark.parametrize(
    ("event", "name", "values", "line"),
    [
        (f"{STATE}.HoveringWarning", "no_gps_too_dark", (1, 0), "light: too dark to hover"),
        (ALERT, "state", ("cut_out", "none"), "alert: cut out"),
        (ALERT, "state", ("motor_error", "low_battery"), "alert: motor error"),
        (MOTORS, "motorError", ("errorStalled", "noError"), "motors: errorStalled of motor 2, 4"),
        (COMPASS, "required", (1, 2), "magnetometer: needs a calibration"),
        (SENSORS, "sensorState", (0, 1), "vertical camera: does not work"),
        ("camera.zoom_level", "level", (1.5, 1.0), "camera: zoomed in, 1.5 times"),
        ("gimbal.calibration_state", "state", ("required", "ok"), "gimbal: needs a calibration"),
        ("gimbal.alert", "error", (4, 0), "gimbal: reports an error (4)"),
        (CHECKLIST, "state", ("on", "off"), "take-off checklist: gyro prevents"),
        ("alarms.alarms", "state", ("on", "off"), "alarm: motor cutout"),
    ],
)
def test_each_reported_fault_lasts_until_it_is_withdrawn(
    caplog: pytest.LogCaptureFixture, event: str, name: str, values: Any, line: str
) -> None:
    report, (bad, good) = SelfReport(), values
    report.take(event, OTHER | {name: bad})
    report.take(event, OTHER | {name: bad})
    (fault,) = report.faults
    assert f"{fault.what}: {fault.found}".startswith(line)
    assert fault.remedy
    assert caplog.text.count(fault.found) == 1
    report.take(event, OTHER | {name: good})
    assert report.faults == ()


def test_a_fault_of_one_part_is_not_withdrawn_by_another_and_outdoors_does_not_count() -> None:
    report = SelfReport(return_home=False)  # which cannot be switched off
    for name in ("barometer", "GPS"):
        report.take(SENSORS, {"sensorName": name, "sensorState": 0})
    report.take(SENSORS, {"sensorName": "magnetometer", "sensorState": 1})
    report.take(CHECKLIST, {"check": "gps", "state": "on"})
    assert [fault.what for fault in report.faults] == ["barometer", "return home"]
    report.take("rth.auto_trigger_mode", {"mode": "on"})
    assert [fault.what for fault in report.faults] == ["barometer"]
    assert SelfReport(return_home=True).faults == ()
