"""Flights to the places of a file, and the copies that are kept of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt import app
from uav_bt.app.flight_record import recorded_files
from uav_bt.app.place import drawn_places
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.store import CampaignStore
from uav_bt.record.reader import RecordReader
from uav_bt.tree import load_tree
from uav_bt.types import Pose2D

pytestmark = pytest.mark.flight

MISSION = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><ReactiveSequence>
<Rules land_on="any"/><Segment/><FindMark/><TrackMotion/><MapSite/>
<Sequence><TakeOff/>
<LoopString queue="file:rounds.csv" value="{p}">
<Sequence><GoTo to="{p}"/><TakePhoto label="{p}"/></Sequence>
</LoopString>
<ForceSuccess><EmergencyLand/></ForceSuccess></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    (tmp_path / "rounds.csv").write_text("frame,x,y\nstart,0.8,0\nstart,0.8,0.6\n")
    path = tmp_path / "mission.xml"
    path.write_text(MISSION)
    return path


def test_the_places_of_a_file_are_visited_and_travel_with_the_record(
    mission: Path, tmp_path: Path
) -> None:
    record = tmp_path / "flight.mcap"
    options = app.FlightOptions(drone="plain", profile="ideal", scene="val-a", record=record)
    result = app.fly(mission, options, out=tmp_path / "out")
    assert result.outcome == "success"
    assert [photo.label for photo in result.photos] == ["start:0.8,0", "start:0.8,0.6"]
    (tmp_path / "rounds.csv").unlink()  # the record does not need it
    reader = RecordReader(record)
    (tmp_path / "again").mkdir()
    files = recorded_files(reader, tmp_path / "again")
    assert files.tree is not None
    tree = load_tree(files.tree)
    start = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    assert [text for text, _ in drawn_places(tree, start)] == ["start:0.8,0", "start:0.8,0.6"]


def test_a_campaign_does_not_go_on_with_other_places(mission: Path, tmp_path: Path) -> None:
    plan = make_plan([mission], flights=1, scenes=["val-a"])
    with CampaignStore.opened(tmp_path / "run", plan, {}):
        pass
    assert plan_of(tmp_path / "run").differences(plan) == []
    (tmp_path / "rounds.csv").write_text("frame,x,y\nstart,0.8,0.1\n")
    assert plan_of(tmp_path / "run").differences(plan) != []
