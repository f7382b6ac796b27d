"""Settings of the drone: changed for a flight, and restored after it."""

from __future__ import annotations

import math
import threading

import pytest

from tests.sim_bridge.olympe.fake_olympe import (
    SETTINGS,
    FakeSdkDrone,
    FakeWorld,
    Time,
    bridge,
)
from uav_bt.types import Command, MoveBy, TakeOff

PATIENCE_S = 30.0
MAX_TILT = "ardrone3.PilotingSettings.MaxTilt"
MAX_ALTITUDE = "ardrone3.PilotingSettings.MaxAltitude"
BANKED_TURN = "ardrone3.PilotingSettings.BankedTurn"
RETURN_HOME = "rth.set_auto_trigger_mode"


def with_firmware(version: str) -> FakeWorld:
    def announce(drone: FakeSdkDrone) -> None:
        drone.event("common.SettingsState.ProductVersionChanged", software=version, hardware="1")

    world = FakeWorld()
    world.on_connect = announce
    return world


def test_what_was_set_before_is_put_back() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world, return_home=False)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    sent = dict(world.drone.sent)
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}
    assert sent[RETURN_HOME] == {"mode": "off"}
    world.drone.sent.clear()
    drone.disconnect()
    assert world.drone.sent == [
        (MAX_TILT, {"current": 20.0}),
        (MAX_ALTITUDE, {"current": 30.0}),
        ("ardrone3.SpeedSettings.MaxVerticalSpeed", {"current": 1.0}),
        ("ardrone3.SpeedSettings.MaxRotationSpeed", {"current": 40.0}),
        (BANKED_TURN, {"value": 1}),
        (RETURN_HOME, {"mode": "on"}),
    ]


def test_what_was_as_wanted_before_is_not_put_back() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world, altitude_limit_m=30.0)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    world.drone.sent.clear()
    drone.disconnect()
    assert MAX_ALTITUDE not in dict(world.drone.sent)


def test_a_limit_that_is_not_confirmed_in_time_is_a_warning_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world, time = with_firmware("1.8.2"), Time()
    world.refused = {MAX_TILT, BANKED_TURN}  # some firmware lacks banked turns
    drone = bridge(world, time)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    time.now_s += 1.9
    drone.observe()
    assert caplog.text == ""
    time.now_s += 0.2
    drone.observe()
    drone.observe()
    (record,) = caplog.records
    assert record.getMessage() == (
        f"the drone does not confirm {MAX_TILT} = 10.0 (it reports 20.0) within 2 s"
    )


def test_a_flight_begins_without_an_answer_about_its_limits() -> None:
    world = with_firmware("1.8.2")
    world.refused = set(SETTINGS)  # no setting is confirmed
    drone = bridge(world)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    assert world.drone.names()[-1] == "TakeOff"


def test_the_drones_own_settings_are_waited_for_before_anything_is_changed() -> None:
    world = with_firmware("1.8.2")
    world.unreported = {MAX_TILT}
    report = ("ardrone3.PilotingSettingsState.MaxTiltChanged", 15.0)
    world.on_video = lambda drone: threading.Timer(
        0.05, lambda: drone.event(report[0], current=report[1])
    ).start()
    drone = bridge(world, setting_limit_s=PATIENCE_S)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    drone.disconnect()
    tilts = [args["current"] for name, args in world.drone.sent if name == MAX_TILT]
    assert tilts == [pytest.approx(10.0), 15.0]


def test_a_setting_that_the_drone_never_reported_is_named_before_and_after(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = with_firmware("1.8.2")
    world.unreported = {MAX_TILT, MAX_ALTITUDE, BANKED_TURN}
    world.refused = {BANKED_TURN}  # firmware without banked turns
    drone = bridge(world, setting_limit_s=0.01)
    drone.connect()
    assert caplog.text == ""
    drone.send(Command(movement=TakeOff()))
    (before,) = caplog.records
    assert "has not reported its present MaxTilt, MaxAltitude, which" in before.getMessage()
    caplog.clear()
    world.drone.sent.clear()
    drone.disconnect()
    (after,) = caplog.records
    assert "the drone keeps this flight's MaxTilt, MaxAltitude: check them" in after.getMessage()
    assert MAX_TILT not in dict(world.drone.sent)


def test_a_setting_that_is_not_put_back_is_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world, setting_limit_s=0.01)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    world.refused = {MAX_TILT}
    drone.disconnect()
    assert f"does not confirm {MAX_TILT} = 20.0 (it reports None)" in caplog.text


def test_who_only_looked_has_nothing_to_put_back() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.disconnect()
    assert world.drone.sent == []


def test_a_drone_that_is_gone_is_not_asked_but_its_changed_settings_are_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    world.drone.sent.clear()
    world.drone.connected = False
    drone.disconnect()
    assert world.drone.sent == []
    assert (
        "the drone keeps this flight's MaxTilt, MaxAltitude, MaxVerticalSpeed, "
        "MaxRotationSpeed, BankedTurn: check them"
    ) in caplog.text


def test_without_a_wish_the_return_home_stays_as_it_is() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    assert RETURN_HOME not in dict(world.drone.sent)


def fly_a_metre(world: FakeWorld) -> dict[str, dict[str, object]]:
    drone = bridge(world, speed_limit_mps=0.4, climb_limit_mps=0.3, yaw_rate_limit_radps=1.0)
    drone.connect()
    world.drone.event("ardrone3.PilotingState.FlyingStateChanged", state="hovering")
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0, yaw_rad=0.5)))
    return dict(world.drone.sent)


@pytest.mark.parametrize("version", ["1.7.0", "1.8.2", "2.0.0-rc1"])
def test_a_movement_keeps_the_speed_limits(version: str) -> None:
    sent = fly_a_metre(with_firmware(version))
    assert sent["move.extended_move_by"] == {
        "d_x": 1.0,
        "d_y": 0.0,
        "d_z": 0.0,
        "d_psi": 0.5,
        "max_horizontal_speed": 0.4,
        "max_vertical_speed": 0.3,
        "max_yaw_rotation_speed": pytest.approx(math.degrees(1.0)),
    }
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}


@pytest.mark.parametrize("version", ["1.6.9", ""])
def test_older_firmware_is_kept_slow_by_its_tilt(version: str) -> None:
    sent = fly_a_metre(with_firmware(version))
    assert "ardrone3.Piloting.moveBy" in sent
    assert sent[MAX_TILT] == {"current": pytest.approx(1.0)}  # the lowest possible setting
