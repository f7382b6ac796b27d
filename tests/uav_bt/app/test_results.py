"""The path and the maps of a flight as arrays, from the flight and from its record."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from uav_bt import app
from uav_bt.app.view.recorded import RecordedFlight

pytestmark = pytest.mark.flight


def test_a_flight_and_its_record_have_the_same_path_and_map(tmp_path: Path) -> None:
    options = app.FlightOptions(
        drone="plain",
        profile="ideal",
        judge=app.JudgeConfig(time_limit_s=6.0),
        record=tmp_path / "flight.mcap",
        record_quality="small",
    )
    flown = app.fly("survey_and_land", options, report=tmp_path / "report.json")

    assert flown.path.shape == (flown.ticks, 5)
    assert np.diff(flown.path[:, 0]) == pytest.approx(0.1)  # a row for each tick
    assert flown.path[-1, 3] == pytest.approx(1.5, abs=0.1)  # the flight height of the tree
    assert flown.site_map is not None
    assert flown.site_map.ground.any()
    assert flown.to_json() == json.loads((tmp_path / "report.json").read_text())

    recorded = RecordedFlight(tmp_path / "flight.mcap")
    assert recorded.path() == pytest.approx(flown.path)
    times, maps = zip(*recorded.maps(), strict=True)
    assert np.diff(times) == pytest.approx(0.5, abs=0.11)
    assert maps[-1].ground.sum() == pytest.approx(flown.site_map.ground.sum(), rel=0.1)


def test_a_tree_without_a_map_has_none() -> None:
    text = (
        '<root BTCPP_format="4"><BehaviorTree ID="M">'
        '<Sequence><TakeOff height_m="1.0"/><Land/></Sequence></BehaviorTree></root>'
    )
    assert app.fly(text, drone="plain", profile="ideal").site_map is None
