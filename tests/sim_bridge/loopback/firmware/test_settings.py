"""Settings, their bounds and events."""

from __future__ import annotations

import math
from typing import Any

import pytest

from sim_bridge.loopback.firmware.settings import SETTINGS, Setting
from sim_bridge.loopback.messages import message_table
from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda one: one.command)
def test_every_setting_is_a_command_and_an_event_that_answers(
    bench: Bench, setting: Setting
) -> None:
    command = message_table().named(setting.command)
    values: dict[str, Any] = {}
    for argument in command.arguments:
        shown = next(
            (shown for shown, given in setting.takes.items() if given == argument.name), ""
        )
        values[argument.name] = setting.start.get(shown, 0)
    bench.events.clear()
    bench.send(setting.command, **values)
    (answer,) = bench.values(setting.event)
    for shown, given in setting.takes.items():
        assert answer[shown] == pytest.approx(values[given]), shown


@pytest.mark.parametrize(
    ("asked", "taken"), [(12.0, 12.0), (0.0, 1.0), (90.0, 40.0), (math.nan, 20.0)]
)
def test_settings_are_taken_within_their_bounds(bench: Bench, asked: float, taken: float) -> None:
    bench.events.clear()
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=asked)
    (answer,) = bench.values("ardrone3.PilotingSettingsState.MaxTiltChanged")
    assert answer == {"current": taken, "min": 1.0, "max": 40.0}


def test_a_reset_brings_the_first_settings_back(bench: Bench) -> None:
    bench.send("ardrone3.PilotingSettings.MaxTilt", current=12.0)
    bench.send("common.Settings.Reset")
    tilt = bench.values("ardrone3.PilotingSettingsState.MaxTiltChanged")
    assert [one["current"] for one in tilt] == [12.0, 20.0]
    assert bench.values("common.SettingsState.ResetChanged") == [{}]
