"""Whole flights: surveys, places of a file, a network without answers; path and map as arrays."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray

from perception.control.runtime import SHIPPED_STUDENT
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.simulated_drone import SimulatedReferee
from tests.paper_lab import BACKGROUND
from uav_bt import app
from uav_bt.app.film import map_of_scene
from uav_bt.app.flight_record import recorded_tree
from uav_bt.app.scene_places import with_places
from uav_bt.app.site import Site
from uav_bt.app.view.recorded import RecordedFlight
from uav_bt.board import SITE_MAP
from uav_bt.campaign import make_plan
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.record.reader import RecordReader
from uav_bt.tree import parse_tree
from uav_bt.tree.shipped import resolve_tree

pytestmark = pytest.mark.flight


def test_a_survey_without_ground_lands_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The floor is not ground in any mask."""

    def background(_: object, _frame: object, width_px: int, height_px: int) -> NDArray[np.uint8]:
        return np.full((height_px, width_px), BACKGROUND, dtype=np.uint8)

    monkeypatch.setattr(SimulatedReferee, "class_ids", background)
    report = app.fly("survey_and_land", drone="plain", seed=1, exact_masks=True)
    assert report.outcome == "aborted"
    assert report.reason.startswith("no ground in view for 30 s")
    assert any("no ground in view" in warning for warning in report.warnings)
    assert not report.airborne_at_end
    assert np.hypot(*(report.path[:, 1:3] - report.path[0, 1:3]).T).max() < 1.0


class Ids:
    """Notes in which ticks each object is on the map."""

    def __init__(self) -> None:
        self.ticks: dict[int, list[int]] = {}

    def follow(self, flight: app.Flight[Drone]) -> list[Ids]:
        self._board = flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        site_map = self._board.read(SITE_MAP).value
        for item in () if site_map is None else site_map.objects:
            self.ticks.setdefault(item.id, []).append(record.index)


def test_a_survey_maps_each_object_once_under_one_id() -> None:
    ids = Ids()
    judge = app.JudgeConfig(time_limit_s=60.0)
    options = app.FlightOptions(scene="train-a", drone="plain", judge=judge)
    flown = app.fly("survey_and_land", options, listeners=[ids.follow])
    assert (flown.objects_found, flown.false_objects) == (8, 0)
    assert max(flown.object_errors_m or ()) < 0.15
    assert flown.site_map is not None
    true = {each.class_id: each for each in load_scene("train-a").ground_plan.standing}
    errors_m = []
    for item in flown.site_map.objects:
        footprint = true[item.class_id].footprint
        assert abs(item.size_m - 2 * max(footprint.half_x_m, footprint.half_y_m)) < 0.15
        if item.height_m is not None:
            errors_m.append(abs(item.height_m - true[item.class_id].height_m))
        there = ids.ticks[item.id]
        assert len(there) >= 0.8 * (flown.ticks - there[0])
    assert len(errors_m) >= 3
    assert max(errors_m) < 0.03
    brief = [there for there in ids.ticks.values() if len(there) < 0.05 * flown.ticks]
    assert len(ids.ticks) - len(brief) == 8


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
    assert flown.to_json() == json.loads((tmp_path / "report.json").read_text())
    recorded = RecordedFlight(tmp_path / "flight.mcap")
    assert recorded.path() == pytest.approx(flown.path)
    times, maps = zip(*recorded.maps(), strict=True)
    assert np.diff(times) == pytest.approx(0.5, abs=0.11)
    assert maps[-1].ground.sum() == pytest.approx(flown.site_map.ground.sum(), rel=0.1)


def test_a_network_without_an_answer_lets_the_drone_hover(tmp_path: Path) -> None:
    """An invalid answer never becomes zero: the drone waits for the next view, with a warning."""
    model = onnx.load(SHIPPED_STUDENT)
    (bias,) = [one for one in model.graph.initializer if one.name == "head.bias"]
    bias.CopyFrom(onnx.numpy_helper.from_array(np.full(5, np.nan, np.float32), bias.name))
    (tmp_path / "nan.onnx").write_bytes(model.SerializeToString())
    text = resolve_tree("explore_and_land_student").read_text(encoding="utf-8")
    text = text.replace('="90000"', '="3000"', 1)  # duration of the exploration, ms
    text = text.replace('"student"', f'"student:{tmp_path}/nan.onnx"')
    flown = app.fly(text, scene="val-b", seed=3, image_size_px=(320, 180))
    assert flown.outcome == "success"
    (warning,) = [event for event in flown.events if event.kind == "warning"]
    assert warning.text.endswith("nan.onnx: the network's answer holds NaN or infinity")
    assert warning.node.endswith("step_or_turn/Explore")


ROUND = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><ReactiveSequence>
<Rules land_on="any"/><Segment/><FindMark/><TrackMotion/><MapSite/>
<Sequence><TakeOff/>
<LoopString queue="file:rounds.csv" value="{p}">
<Sequence><GoTo to="{p}"/><TakePhoto label="{p}"/></Sequence>
</LoopString>
<ForceSuccess><EmergencyLand/></ForceSuccess></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


def test_places_of_a_file_are_visited_and_kept_with_record_and_plan(tmp_path: Path) -> None:
    (tmp_path / "rounds.csv").write_text("frame,x,y\nstart,0.8,0\nstart,0.8,0.6\n")
    mission, record = tmp_path / "mission.xml", tmp_path / "flight.mcap"
    mission.write_text(ROUND)
    plan = make_plan([mission], flights=1, scenes=["val-a"])
    options = app.FlightOptions(drone="plain", profile="ideal", scene="val-a", record=record)
    result = app.fly(mission, options, out=tmp_path / "out")
    assert result.outcome == "success"
    assert [photo.label for photo in result.photos] == ["start:0.8,0", "start:0.8,0.6"]
    (tmp_path / "rounds.csv").write_text("frame,x,y\nstart,0.8,0.1\n")
    assert make_plan([mission], flights=1, scenes=["val-a"]).differences(plan) != []
    (tmp_path / "rounds.csv").unlink()  # the record does not need it
    tree = recorded_tree(RecordReader(record))
    assert tree is not None
    scene = load_scene("val-a")
    drawn = with_places(map_of_scene(scene), parse_tree(tree), scene, Site())
    assert [place.text for place in drawn.places] == ["start:0.8,0", "start:0.8,0.6"]
