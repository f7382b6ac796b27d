"""The firmware as a whole."""

from __future__ import annotations

import pytest

from sim_bridge.loopback.world import GROUND_M, HOME
from tests.sim_bridge.loopback.loopback_world import Bench


@pytest.mark.parametrize(
    ("command", "why"),
    [
        ("ardrone3.Animations.Flip", "not simulated"),
        ("ardrone3.Piloting.CancelMoveBy", "not a command of the ANAFI"),
    ],
)
def test_a_command_that_is_not_simulated_changes_nothing_and_is_named_once(
    bench: Bench, command: str, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    bench.events.clear()
    for _ in range(3):
        bench.send(command, direction="front")
    assert bench.events == []
    assert bench.world.orders == []
    (line,) = caplog.messages
    assert line.startswith(f"{command} is {why}: ")


@pytest.mark.parametrize("event", ["GpsLocationChanged", "PositionChanged"])
def test_a_position_on_earth_is_above_sea_level(bench: Bench, event: str) -> None:
    bench.fly()
    bench.run(1.0)
    place = bench.values(f"ardrone3.PilotingState.{event}")[-1]
    assert place["altitude"] == pytest.approx(GROUND_M + bench.world.state().altitude_m)
    assert place["latitude"] == pytest.approx(HOME.latitude_deg)


def test_without_a_fix_it_does_not_know_where_it_is_and_does_not_return() -> None:
    bench = Bench(gps=False)
    names = {"fixed": "ardrone3.GPSSettingsState.GPSFixStateChanged"}
    bench.send("common.Settings.AllSettings")
    assert bench.values(names["fixed"]) == [{"fixed": 0}]
    bench.fly()
    bench.run(1.0)
    place = bench.values("ardrone3.PilotingState.GpsLocationChanged")[-1]
    assert {place[name] for name in ("latitude", "longitude", "altitude")} == {500.0}
    bench.send("rth.return_to_home")
    bench.run(1.0)
    assert bench.values("rth.state") == []
    assert bench.values("rth.home_location") == []
