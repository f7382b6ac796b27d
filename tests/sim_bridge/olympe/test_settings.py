"""Settings of the drone: changed for a flight, and restored after it."""

from __future__ import annotations

import threading

import pytest

from sim_bridge.olympe import settings
from tests.sim_bridge.olympe.fake_olympe import (
    BANKED_TURN,
    MAX_ALTITUDE,
    MAX_TILT,
    PATIENCE_S,
    RETURN_HOME,
    SETTINGS,
    FakeWorld,
    Flight,
)
from uav_bt.types import TakeOff


def test_former_values_are_restored_where_the_flight_changed_them() -> None:
    flight = Flight(FakeWorld(firmware="1.8.2"), return_home=False)
    flight.play(TakeOff())
    sent = dict(flight.sdk.sent)
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}
    assert (sent[BANKED_TURN], sent[RETURN_HOME]) == ({"value": 0}, {"mode": "off"})
    flight.sdk.sent.clear()
    flight.drone.disconnect()
    former = [(name, value) for name, (_, _, value) in SETTINGS.items()]
    assert [(name, *args.values()) for name, args in flight.sdk.sent] == former


def test_settings_that_the_flight_did_not_change_are_not_sent() -> None:
    for movements, unsent in [((), set(SETTINGS)), ((TakeOff(),), {MAX_ALTITUDE, RETURN_HOME})]:
        flight = Flight(altitude_limit_m=30.0)
        flight.play(*movements)
        flight.sdk.sent.clear()
        flight.drone.disconnect()
        assert not unsent & {name for name, _ in flight.sdk.sent}


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


def test_a_late_report_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", PATIENCE_S)
    event = SETTINGS[MAX_TILT][0]
    later = threading.Timer(0.05, lambda: world.made[0].event(event, current=15.0))
    world = FakeWorld(firmware="1.8.2", unreported={MAX_TILT}, on_connect=lambda _: later.start())
    flight = Flight(world)
    assert later.finished.is_set()
    flight.play(TakeOff())
    flight.drone.disconnect()
    assert flight.sdk.args(MAX_TILT)[1:] == [{"current": 15.0}]


ALL = "MaxTilt, MaxAltitude, MaxVerticalSpeed, MaxRotationSpeed"


@pytest.mark.parametrize(
    ("unreported", "refused", "gone", "line"),
    [
        ({MAX_TILT, MAX_ALTITUDE}, set(), False, "keeps this flight's MaxTilt, MaxAltitude: check"),
        # Firmware without banked turns is not warned of.
        ({BANKED_TURN}, {BANKED_TURN}, True, f"keeps this flight's {ALL}: check"),
        (set(), set(), True, f"keeps this flight's {ALL}, BankedTurn: check"),
        (set(), {MAX_TILT}, False, f"does not confirm {MAX_TILT} = 20.0 (it reports None)"),
    ],
)
def test_settings_that_cannot_be_restored_are_named(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    unreported: set[str],
    refused: set[str],
    line: str,
    *,
    gone: bool,
) -> None:
    monkeypatch.setattr(settings, "LIMIT_S", 0.01)
    flight = Flight(FakeWorld(unreported=unreported, refused=refused))
    flight.play(TakeOff())
    flight.sdk.sent.clear()
    flight.sdk.connected = not gone
    flight.drone.disconnect()
    assert line in caplog.text
    restored = {name for name, _ in flight.sdk.sent}
    assert restored == (set() if gone else set(SETTINGS) - unreported - {RETURN_HOME})
