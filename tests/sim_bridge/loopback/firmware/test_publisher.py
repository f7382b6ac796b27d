"""States for new clients."""

from __future__ import annotations

from tests.sim_bridge.loopback.loopback_world import Bench


def test_a_newcomer_gets_all_states_then_all_settings(bench: Bench) -> None:
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
    bench.events.clear()
    bench.send("common.Settings.AllSettings")
    names = bench.names()
    assert names[-1] == "common.SettingsState.AllSettingsChanged"
    assert {
        "common.SettingsState.ProductNameChanged",
        "ardrone3.PilotingSettingsState.MaxTiltChanged",
        "ardrone3.GPSSettingsState.HomeChanged",
    } <= set(names)
    assert not set(names) & set(states)


def test_all_that_is_sent_are_events(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    bench.send("common.Settings.AllSettings")
    assert all(one.type.event for one in bench.events)


def test_states_are_sent_once_until_they_change(bench: Bench) -> None:
    bench.events.clear()
    bench.run(2.0)
    assert bench.flying_states() == []
    assert bench.values("common.CommonState.BatteryStateChanged") == []
