"""Whole campaigns: stored, resumed, reproducible, with an output folder for each flight."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import comparable, fly, line, plan
from uav_bt.app import provenance
from uav_bt.app.options import FlightOptions
from uav_bt.campaign import CampaignResult
from uav_bt.campaign.plan import CampaignPlan, FlightTask
from uav_bt.campaign.runner import LocalBackend, run
from uav_bt.campaign.workers import PathKeeper, fly_task
from uav_bt.errors import InputError, ValueRangeError


def flown(wanted: CampaignPlan, folder: Path, *, workers: int = 2, **how: Any) -> CampaignResult:
    return run(wanted, folder, backend=LocalBackend(workers), fly=fly, **how)


def kept_seeds(folder: Path) -> list[int]:
    lines = (folder / "flights.jsonl").read_text().splitlines()
    return [json.loads(line)["seed"] for line in lines]


def test_one_and_two_workers_fly_the_same_flights(tmp_path: Path) -> None:
    wanted = plan(trees=("a.xml", "b.xml"), flights=3)
    one = flown(wanted, tmp_path / "one", workers=1)
    two = flown(wanted, tmp_path / "two", workers=2)
    assert len(one.flights) == 6
    assert [comparable(f) for f in one.flights] == [comparable(f) for f in two.flights]
    assert len({flight["wall_s"] for flight in one.flights}) == 1, "one process flies them all"


def test_a_stopped_campaign_flies_the_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = plan(flights=4)

    def stop(_flight: Any, _now: bool) -> None:  # noqa: FBT001 - as the campaign calls it
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flown(wanted, tmp_path, on_flight=stop)
    assert len(kept_seeds(tmp_path)) == 1
    told: list[bool] = []
    result = flown(wanted, tmp_path, on_flight=lambda _, now: told.append(now))
    assert told == [False, True, True, True]
    assert result.flown_now == 3
    assert sorted(kept_seeds(tmp_path)) == [0, 1, 2, 3]
    notes: list[str] = []
    monkeypatch.setattr(provenance, "commit", lambda: "another")
    more = flown(plan(flights=5), tmp_path, on_note=notes.append)
    assert (more.flown_now, len(more.flights)) == (1, 5)
    assert [note.partition(" (")[0] for note in notes] == [
        "the code has changed since the last run"
    ]


def test_a_refused_flight_ends_the_campaign_and_is_not_kept(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such weights"):
        flown(plan(flights=9, policies={"1": "is refused"}), tmp_path, workers=1)
    assert kept_seeds(tmp_path) == [0]


def test_no_workers_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="at least one worker, got 0"):
        LocalBackend(0)


# --- output folders of flights -------------------------------------------------------------------

BODY = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence name="m">
<Segment/><FindMark/><TrackMotion/><MapSite/>
<Sequence name="s"><TakeOff/>{}<HelipadCenter/><Land/></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


def task_with(tmp_path: Path, body: str) -> FlightTask:
    tree = tmp_path / "tree.xml"
    tree.write_text(BODY.format(body), encoding="utf-8")
    return FlightTask(
        tree="tree.xml",
        tree_path=str(tree),
        scene="val-a",
        folder=str(tmp_path / "flights" / "tree-val-a-0"),
        options=FlightOptions(drone="plain", profile="ideal", scene="val-a"),
    )


@pytest.mark.flight
def test_a_mission_that_writes_files_has_a_folder(tmp_path: Path) -> None:
    flown = task_with(tmp_path, '<TakePhoto label="door"/>')
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


@pytest.mark.flight
def test_a_mission_that_writes_none_has_no_folder(tmp_path: Path) -> None:
    flight = fly_task(task_with(tmp_path, ""))
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
