"""Replays: equal without changes, otherwise different from the tick of the change on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from behaviours.fly.land import Land
from tests.worlds.records import FLIGHT, copy_part, fly_noisy
from tests.worlds.trees import document, tree_file
from uav_bt import app
from uav_bt.app import flight_record
from uav_bt.app.replay import ReplayOptions, replay
from uav_bt.app.replay.recorded_drone import MovementIds
from uav_bt.app.replay.replayer import assemble_recorded
from uav_bt.errors import FileError
from uav_bt.mission.runner import MissionRunner
from uav_bt.record import encoder
from uav_bt.record.reader import RecordReader
from uav_bt.tree import Status
from uav_bt.types import (
    DroneState,
    FlyingState,
    Hover,
    MoveBy,
    MovementState,
    MovementStatus,
    Velocity,
)
from uav_bt.types.flight_results import EventKind

# With networks, detector, tracker, memory and policy: everything that affects decisions.
PERCEIVING = """
<ReactiveSequence>
  <Segment model="unet"/>
  <FindMark/>
  <TrackMotion/>
  <MapSite/>
  <Sequence>
    <TakeOff height_m="1.0"/>
    <Fallback><Explore policy="segmentation"/><Avoid policy="segmentation"/></Fallback>
    <Land/>
  </Sequence>
</ReactiveSequence>
"""
SMALL = app.FlightOptions(scene="val-a", seed=3, profile="lab", image_size_px=(160, 90))


@pytest.fixture(scope="module")
def perceived(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the lossless record of a flight of the twin."""
    folder = tmp_path_factory.mktemp("perceived")
    record = folder / "flight.mcap"
    report = app.fly(tree_file(folder, PERCEIVING), replace(SMALL, record=record))
    assert report.ticks > 60
    return record


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the record of a flight without perception."""
    with pytest.MonkeyPatch.context() as patch:
        return fly_noisy(tmp_path_factory.mktemp("noisy"), patch)[0]


@pytest.mark.parametrize("masks", ["network", "recorded"])
def test_a_flight_with_networks_replays_without_a_difference(perceived: Path, masks: Any) -> None:
    report = replay(perceived, ReplayOptions(masks=masks))
    assert (report.status_ticks, report.command_ticks) == (0, 0)
    assert (report.exact, report.same, report.masks) == (True, True, masks)
    assert report.ticks > 60


def test_a_changed_mission_differs_from_where_it_was_changed(noisy: Path) -> None:
    unchanged = replay(noisy)
    assert (unchanged.same, unchanged.differences, unchanged.outcome) == (True, [], "success")
    changed = replay(noisy, ReplayOptions(tree=document(FLIGHT.replace('"-90"', '"-60"'))))
    assert not changed.same
    first = changed.differences[0]
    assert first.command is not None
    assert "90 deg left" in first.command[0]
    assert "60 deg left" in first.command[1]
    assert first.statuses == {}  # equal until then
    # Otherwise its movement is equal: it ends when the recorded one ended.
    assert changed.status_ticks == 0


def test_trees_of_other_nodes_and_ends_are_compared(noisy: Path, tmp_path: Path) -> None:
    tree = tree_file(tmp_path, FLIGHT.replace('name="back"', 'name="home"'), "changed.xml")
    report = replay(noisy, ReplayOptions(tree=tree))
    assert report.tree == str(tree)
    assert report.only_recorded == ("Main/Sequence/back",)
    assert report.only_replayed == ("Main/Sequence/home",)
    assert not report.same
    short = replay(noisy, ReplayOptions(tree=document('<TakeOff height_m="1.5"/>')))
    assert short.ticks == report.ticks  # a tree that ends early ends nothing else
    assert not short.same


def test_a_leaf_that_fails_ends_the_replay(noisy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Land, "update", lambda _: 1 / 0)
    report = replay(noisy)
    assert "ZeroDivisionError" in str(report.ended)
    assert not report.same


@pytest.mark.parametrize("within", [False, True])
def test_an_operators_stop_is_repeated_in_its_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, within: bool
) -> None:
    tick_tree = MissionRunner._tick_tree

    def stop(self: MissionRunner) -> Status:
        status = tick_tree(self) if within else None
        if self._index == 14:
            self.abort.request("stopped by SIGINT")
        return tick_tree(self) if status is None else status

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MissionRunner, "_tick_tree", stop)
        record, flown = fly_noisy(tmp_path, monkeypatch)
    assert flown.outcome == "aborted"
    report = replay(record)
    assert report.differences == []
    assert report.same


def test_a_lossy_record_replays_within_its_tolerance_and_the_recorded_limits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = app.FlightOptions(limits=app.Limits(ceiling_m=1.2), record_quality="high")
    # A height from a variable is known only in flight; there the arbiter enforces the ceiling.
    body = FLIGHT.replace('"1.5"', '"{h}"').replace("<TakeOff", '<Script code="h := 1.5"/><TakeOff')
    record, _ = fly_noisy(tmp_path, monkeypatch, body=body, options=options)
    report = replay(record)
    assert (report.exact, report.same) == (False, True)


def test_only_a_part_from_the_beginning_replays(noisy: Path, tmp_path: Path) -> None:
    head, tail = tmp_path / "head.mcap", tmp_path / "tail.mcap"
    copy_part(noisy, head, to_s=1.0)
    copy_part(noisy, tail, from_s=0.5, to_s=1.0)
    report = replay(head)
    assert (report.same, report.ticks) == (True, 10)
    with pytest.raises(FileError, match=r"begins 0\.5 s into its flight"):
        replay(tail)


def test_a_lost_picture_makes_it_inexact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = encoder.MomentEncoder.encode

    def blind(self: encoder.MomentEncoder, moment: encoder.RawMoment, *, images: bool) -> Any:
        return whole(self, moment, images=images and moment.tick.index != 4)

    monkeypatch.setattr(encoder.MomentEncoder, "encode", blind)
    report = replay(fly_noisy(tmp_path, monkeypatch)[0])
    assert (report.missing_images, report.exact) == (1, False)


def test_attachments_without_the_tree_or_outside_their_folder_are_refused(
    noisy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight_record, "_TREE_FOLDER", "trees/")
        with pytest.raises(FileError, match=r"lacks its tree file \(mission\.xml\); give the tree"):
            replay(noisy)
        patch.setattr(flight_record, "_TREE_FOLDER", "tree/../../")
        record, _ = fly_noisy(tmp_path, monkeypatch)
    with pytest.raises(FileError, match="lacks its tree file"):
        replay(record)


def test_a_flight_in_a_site_on_exact_masks_replays_as_it_was_flown(tmp_path: Path) -> None:
    """Height, limits and ground classes are the recorded ones, and so are the masks."""
    site = app.Site(
        flight_height_m=1.2,
        ground=("carpet", "background"),
        limits=app.Limits(ceiling_m=2.0, speed_mps=0.4),
    )
    record = tmp_path / "flight.mcap"
    options = replace(SMALL, site=site, record=record, exact_masks=True)
    app.fly(tree_file(tmp_path, PERCEIVING), options)
    flight, _ = assemble_recorded(RecordReader(record), ReplayOptions())
    assert flight.options.site == site
    assert flight.context.ground == site.ground
    assert flight.mission.find("TakeOff").port_value("height_m") == 1.2
    report = replay(record)
    assert (report.same, report.masks) == (True, "recorded"), report.differences[:3]


def test_answers_arrive_at_the_movement_that_began_with_the_recorded_one() -> None:
    def told(movement_id: int) -> int | None:
        status = MovementStatus(id=movement_id, state=MovementState.DONE)
        state = DroneState(captured_s=0.0, flying=FlyingState.HOVERING, movement=status)
        return getattr(ids.translated(state).movement, "id", None)

    ids = MovementIds()
    assert told(7) == -7  # an answer that nobody waits for
    assert ids.pair(MoveBy(id=7), MoveBy(id=3))
    assert ids.pair(MoveBy(id=7), MoveBy(id=3))
    assert told(7) == 3
    # A movement that goes on when the recorded one is new is another.
    assert not ids.pair(MoveBy(id=2), MoveBy(id=3))
    assert not ids.pair(MoveBy(id=7), MoveBy(id=2))
    assert ids.pair(Hover(), Velocity(forward_mps=1.0))
    assert ids.pair(Hover(), MoveBy(id=1))


@pytest.mark.parametrize(
    ("topic", "masks", "words"),
    [
        ("/camera/image", "network", "has no frames .no message on /camera/image"),
        ("/camera/frame", "network", "has no frames .no message on /camera/frame"),
        ("/perception/class_map", "recorded", "has no class maps"),
    ],
)
def test_a_record_without_what_the_tree_perceives_is_refused(
    perceived: Path, tmp_path: Path, topic: str, masks: Any, words: str
) -> None:
    """Its replay would differ because of the missing data, not because of the program."""
    part = copy_part(perceived, tmp_path / "part.mcap", without=topic)
    with pytest.raises(FileError, match=words):
        replay(part, ReplayOptions(masks=masks))


@pytest.mark.parametrize("keeps", [True, False], ids=["with a folder", "without one"])
def test_a_leaf_that_writes_files_answers_as_in_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, keeps: bool
) -> None:
    body = "<Sequence><TakeOff/><ForceSuccess><TakePhoto/></ForceSuccess><Land/></Sequence>"
    out = tmp_path / "out" if keeps else None
    record, report = fly_noisy(tmp_path, monkeypatch, body=body, out=out)
    assert [photo.file for photo in report.photos] == (["photo-001.jpg"] if keeps else [])
    kinds = [event.kind for event in report.events]
    assert (EventKind.PHOTO if keeps else EventKind.NO_PHOTO) in kinds
    assert replay(record).same


def test_a_replay_has_the_variables_and_ports_that_the_flight_was_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    turns = '<Repeat num_cycles="{laps}"><Turn degrees="{turn_deg}"/></Repeat>'
    body = f'<Sequence><TakeOff height_m="1.5"/>{turns}<Land/></Sequence>'
    params = tmp_path / "params.yaml"
    params.write_text("{set: {TakeOff.height_m: 1.2}, var: {laps: 2, turn_deg: 30}}")
    options = app.FlightOptions(params=params, variables={"turn_deg": 45})
    record, report = fly_noisy(tmp_path, monkeypatch, body=body, options=options)
    assert report.ports == {"TakeOff.height_m": "1.2"}
    assert report.variables == {"laps": 2, "turn_deg": 45}
    assert replay(record).same
    flight, _ = assemble_recorded(RecordReader(record), ReplayOptions())
    assert flight.mission.variables.snapshot() == {"laps": 2, "turn_deg": 45}
    assert flight.mission.find("TakeOff").port_value("height_m") == 1.2
