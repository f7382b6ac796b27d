"""Output folders of a campaign's flights."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import line, plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign import run
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.workers import PathKeeper, fly_task

pytestmark = pytest.mark.flight

BODY = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence name="m">
<Segment/><FindMark/><TrackMotion/><MapSite/>
<Sequence name="s"><TakeOff/>{}<HelipadCenter/><Land/></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


def task(tmp_path: Path, body: str) -> FlightTask:
    tree = tmp_path / "tree.xml"
    tree.write_text(BODY.format(body), encoding="utf-8")
    return FlightTask(
        tree="tree.xml",
        tree_path=str(tree),
        scene="val-a",
        folder=str(tmp_path / "flights" / "tree-val-a-0"),
        options=FlightOptions(drone="plain", profile="ideal", scene="val-a"),
    )


def test_a_mission_that_writes_files_has_a_folder(tmp_path: Path) -> None:
    flown = task(tmp_path, '<TakePhoto label="door"/>')
    assert flown.folder is not None
    folder = Path(flown.folder)
    folder.mkdir(parents=True)
    (folder / "photo-009.jpg").write_text("of an interrupted flight", encoding="utf-8")
    flight = fly_task(flown)
    assert flight["outcome"] == "success"
    assert {file.name for file in folder.iterdir()} == {
        *("objects.json", "objects.csv"),
        *("photo-001-door-classes.png", "photo-001-door.json"),
    }
    assert [photo["label"] for photo in flight["photos"]] == ["door"]


def test_a_mission_that_writes_none_has_no_folder(tmp_path: Path) -> None:
    flight = fly_task(task(tmp_path, ""))
    assert flight["outcome"] == "success"
    assert flight["objects"]
    assert list((tmp_path / "flights").iterdir()) == []


def write_each(task: FlightTask) -> dict[str, Any]:
    """Write a file for each flight, in a worker's process."""
    assert task.folder is not None
    assert task.options.record is not None
    Path(task.folder).mkdir(parents=True)
    Path(task.options.record).write_text(task.scene, encoding="utf-8")
    return line(task.options.seed, tree=task.tree, scene=task.scene)


@pytest.mark.parametrize(
    ("trees", "scenes"),
    [
        (("one.xml",), ("room 1", "room_1", "../room 2")),
        (("survey.xml", "survey-val.xml"), ("val-a", "a")),
    ],
)
def test_each_flight_has_files_of_its_own(
    tmp_path: Path, trees: tuple[str, ...], scenes: tuple[str, ...]
) -> None:
    planned = plan(trees=trees, scenes=scenes, flights=1, record=True)
    flights = run(planned, tmp_path, fly=write_each).flights
    for name in ("folder", "record"):
        assert len({flight[name] for flight in flights}) == len(flights)
    for flight in flights:
        assert (tmp_path / flight["record"]).read_text(encoding="utf-8") == flight["scene"]
    alone = [flight for flight in flights if flight["scene"] == "../room 2"]
    assert all(flight["folder"] == "flights/one-.._room_2-0" for flight in alone)
    assert all(flight["record"] == "records/one-.._room_2-0.mcap" for flight in alone)


def test_the_way_is_kept_twice_a_second_to_the_millimetre() -> None:
    keeper = PathKeeper()
    for tick in range(11):
        pose = SimpleNamespace(x_m=tick / 3, y_m=-1.0, z_m=1.23456)
        keeper.on_tick(SimpleNamespace(time_s=0.1 * tick, truth=SimpleNamespace(pose=pose)))  # type: ignore[arg-type]
    keeper.on_tick(SimpleNamespace(time_s=9.0, truth=None))  # type: ignore[arg-type]
    assert keeper.points == [
        *((0.0, 0.0, -1.0, 1.235), (0.5, 1.667, -1.0, 1.235), (1.0, 3.333, -1.0, 1.235))
    ]
