"""Settings of the drone: changed for a flight, and restored after it."""

from __future__ import annotations

import threading

import pytest

from sim_bridge.olympe import settings
from tests.sim_bridge.olympe.fake_olympe import (
    BANKED_TURN,
    CLIMB,
    MAX_ALTITUDE,
    MAX_TILT,
    PATIENCE_S,
    RETURN_HOME,
    ROTATION,
    SETTINGS,
    FakeWorld,
    Time,
    bridge,
    say,
)
from uav_bt.types import TakeOff


def test_former_values_are_restored_where_the_flight_changed_them() -> None:
    world = FakeWorld(firmware="1.8.2")
    drone = bridge(world, return_home=False)
    drone.connect()
    say(drone, TakeOff())
    sent = dict(world.drone.sent)
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}
    assert sent[RETURN_HOME] == {"mode": "off"}
    world.drone.sent.clear()
    drone.disconnect()
    assert world.drone.sent == [
        (MAX_TILT, {"current": 20.0}),
        (MAX_ALTITUDE, {"current": 30.0}),
        (CLIMB, {"current": 1.0}),
        (ROTATION, {"current": 40.0}),
        (BANKED_TURN, {"value": 1}),
        (RETURN_HOME, {"mode": "on"}),
    ]


def test_settings_that_the_flight_did_not_change_are_not_sent() -> None:
    world = FakeWorld()
    drone = bridge(world, altitude_limit_m=30.0)
    for movements, unsent in [((), set(SETTINGS)), ((TakeOff(),), {MAX_ALTITUDE, RETURN_HOME})]:
        drone.connect()
        say(drone, *movements)
        world.drone.sent = [each for each in world.drone.sent if each[0] == RETURN_HOME]
        drone.disconnect()
        assert not unsent & {name for name, _ in world.drone.sent}


def test_a_limit_that_is_not_confirmed_in_time_is_a_warning_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world, time = FakeWorld(firmware="1.8.2"), Time()
    world.refused = {MAX_TILT, BANKED_TURN}  # some firmware lacks banked turns
    drone = bridge(world, time)
    drone.connect()
    say(drone, TakeOff())
    assert world.drone.names()[-1] == "TakeOff"  # nothing waits for an answer
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


def test_a_late_report_is_waited_for_before_anything_is_changed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", PATIENCE_S)
    world = FakeWorld(firmware="1.8.2")
    world.unreported = {MAX_TILT}
    event = SETTINGS[MAX_TILT][0]
    later = threading.Timer(0.05, lambda: world.drone.event(event, current=15.0))
    world.on_connect = lambda _: later.start()
    drone = bridge(world)
    drone.connect()
    say(drone, TakeOff())
    drone.disconnect()
    tilts = [args["current"] for name, args in world.drone.sent if name == MAX_TILT]
    assert tilts[1:] == [15.0]


@pytest.mark.parametrize(
    ("unreported", "gone", "names"),
    [
        ({MAX_TILT, MAX_ALTITUDE}, False, "MaxTilt, MaxAltitude"),
        # Firmware without banked turns is not warned of.
        ({BANKED_TURN}, True, "MaxTilt, MaxAltitude, MaxVerticalSpeed, MaxRotationSpeed"),
        (set(), True, "MaxTilt, MaxAltitude, MaxVerticalSpeed, MaxRotationSpeed, BankedTurn"),
    ],
)
def test_settings_that_cannot_be_restored_are_named(
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    unreported: set[str],
    gone: bool,  # noqa: FBT001
    names: str,
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", 0.01)
    world = FakeWorld()
    world.unreported = unreported
    world.refused = unreported & {BANKED_TURN}
    drone = bridge(world)
    drone.connect()
    say(drone, TakeOff())
    world.drone.sent.clear()
    world.drone.connected = not gone
    drone.disconnect()
    (record,) = caplog.records
    assert f"the drone keeps this flight's {names}: check them" in record.getMessage()
    restored = {name for name, _ in world.drone.sent}
    assert restored == (set() if gone else set(SETTINGS) - unreported - {RETURN_HOME})


def test_a_setting_that_is_not_restored_is_a_warning(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", 0.01)
    world = FakeWorld()
    drone = bridge(world)
    drone.connect()
    say(drone, TakeOff())
    world.refused = {MAX_TILT}
    drone.disconnect()
    assert f"does not confirm {MAX_TILT} = 20.0 (it reports None)" in caplog.text
