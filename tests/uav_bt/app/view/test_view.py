"""Views and films of flights, live and from records; playback equals the flight."""

from __future__ import annotations

import copy
import io
import math
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from rich.console import Console

from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.display.display_world import World
from tests.worlds import values
from tests.worlds.trees import document, tree_file
from uav_bt import app
from uav_bt.app import film
from uav_bt.app.view import recorded
from uav_bt.app.view.live import saved_view
from uav_bt.app.view.recorded import RecordedFlight
from uav_bt.display.rerun import sinks
from uav_bt.errors import FileError, TreeError
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status, parse_tree
from uav_bt.types import ClassMap, DepthMap, Frame, NearObstacles, Pose2D

MISSION = """
<ReactiveSequence name="mission">
  <Segment model="unet"/>
  <FindMark/>
  <TrackMotion/>
  <MapSite/>
  <Sequence name="hop">
    <TakeOff height_m="1.0" gimbal_deg="-30"/>
    <Turn name="round" degrees="40"/>
    <Land/>
  </Sequence>
</ReactiveSequence>
"""
OPTIONS = app.FlightOptions(
    scene="val-a", seed=4, profile="ideal", image_size_px=(160, 90), exact_masks=True
)
ENTITIES = (
    *("/world/lab/things", "/world/path", "/world/camera/image"),
    *("/mask/ids", "/tree", "/words", "/plots/height/telemetry", "/plots/tick_time/compute"),
)


@dataclass
class Seen:
    """The record of a flight, and the ticks, boards and statuses that a live follower saw."""

    record: Path
    ticks: list[TickRecord] = field(default_factory=list)
    boards: list[dict[str, tuple[Any, float]]] = field(default_factory=list)
    statuses: list[dict[str, Status]] = field(default_factory=list)

    def follow(self, flight: app.Flight[Drone]) -> Sequence[TickListener]:
        self._flight = flight
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        tree, board = self._flight.mission, self._flight.context.board
        self.ticks.append(record)
        self.boards.append(copy.copy(board.snapshot()))
        self.statuses.append({node.path: node.node_status for node in tree.nodes()})


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """A short flight of the twin."""
    folder = tmp_path_factory.mktemp("flown")
    seen = Seen(folder / "flight.mcap")
    options = replace(OPTIONS, record=seen.record)
    app.fly(tree_file(folder, MISSION), options, listeners=[seen.follow])
    return seen


def contents(path: Path) -> str:
    """Return the content of a file as Rerun's program reads it, without a warning."""
    program = sinks.viewer_command(1, None)[0]
    told = subprocess.run(  # noqa: S603  # the program of Rerun's wheel
        [program, "rrd", "print", str(path)], capture_output=True, text=True, check=True
    )
    assert "WARN" not in told.stderr
    return told.stdout


# --- playback -------------------------------------------------------------------------------------

NOTED = (
    *("index", "time_s", "tree_status", "phase", "active", "command", "decided", "proposed_by"),
    *("override", "truth", "feedback", "compute_s"),
)


def plain(value: Any) -> Any:
    """Return a value that can be compared: arrays as lists."""
    match value:
        case Frame():
            return (value.index, value.captured_s, value.attitude, value.image.tobytes())
        case ClassMap():
            return (value.captured_s, value.ids.tobytes())
        case NearObstacles():
            return (value.captured_s, value.points_m.tolist(), value.unplaced_rad.tolist())
        case _:
            return value


def test_ticks_board_and_statuses_are_those_that_were_flown(flown: Seen) -> None:
    playback, compared = Playback(RecordReader(flown.record)), 0
    lives = zip(playback.ticks(), flown.ticks, flown.boards, flown.statuses, strict=True)
    for again, live, board, statuses in lives:
        for name in NOTED:
            assert getattr(again, name) == getattr(live, name), (live.index, name)
        assert again.observation.state == live.observation.state
        assert plain(again.observation.frame) == plain(live.observation.frame)
        assert dict(playback.statuses()) == statuses, live.index
        kept = playback.board.snapshot()
        for name in ("class_map", "mark", "phase", "elapsed_s", "frame", "site_map"):
            assert (name in kept) == (name in board), (live.index, name)
        for name in {"class_map", "mark", "phase", "elapsed_s", "frame"} & kept.keys():
            assert plain(kept[name][0]) == plain(board[name][0]), (live.index, name)
            assert kept[name][1] == board[name][1], (live.index, name)
        if "site_map" in kept:  # two per second are recorded, obstacles in every tick
            ours, theirs = kept["site_map"][0], board["site_map"][0]
            assert 0.0 <= theirs.captured_s - ours.captured_s <= 0.6
            assert ours.restarts == theirs.restarts
            assert plain(ours.near) == plain(theirs.near)
            compared += 1
    assert len(flown.ticks) > 50
    assert compared > 20


def test_a_part_begins_and_ends_at_the_given_times(flown: Seen) -> None:
    reader = RecordReader(flown.record)
    times = np.array([tick.time_s for tick in Playback(reader).ticks(from_s=2.0, to_s=3.0)])
    assert len(times) == 10
    assert times - reader.timeline.start_s == pytest.approx(np.arange(2.0, 3.0, 0.1))


# --- views ----------------------------------------------------------------------------------------


def test_a_record_becomes_a_file_that_rerun_reads(flown: Seen, tmp_path: Path) -> None:
    steps: list[tuple[str, int, int]] = []
    flight = RecordedFlight(flown.record, from_s=2.0, to_s=4.0)
    flight.save(tmp_path / "flight.rrd", advance=lambda *told: steps.append(told))
    facts = flight.facts
    assert facts.title == "mission in val-a, seed 4"
    assert flight.damages == ()
    told = contents(tmp_path / "flight.rrd")
    assert all(entity in told for entity in ENTITIES)
    assert "log_time" not in told  # the mission's time alone
    assert steps[-1] == ("view", 20, 20)
    assert flight.tree is not None
    assert [path for path, _ in facts.nodes] == [node.path for node in flight.tree.nodes()]
    assert facts.camera == flight.reader.camera
    assert facts.lab_map is not None
    assert len(facts.lab_map.boxes) > 0
    assert (facts.makes_map, facts.makes_depth, facts.intruding) == (True, False, None)


def test_a_record_becomes_a_film_with_its_outcome(flown: Seen, tmp_path: Path) -> None:
    RecordedFlight(flown.record, to_s=1.0).film(tmp_path / "flight.mp4")
    with av.open(str(tmp_path / "flight.mp4")) as container:
        pictures = sum(1 for _ in container.decode(video=0))
    assert pictures >= 10 + 20  # the ticks, and the outcome for two seconds


@pytest.mark.parametrize("lost", ["tree", "lab"])
def test_a_record_is_shown_without_the_nodes_or_the_lab_that_are_not_here(
    lost: str, flown: Seen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise TreeError("x.xml", ["no such node"]) if lost == "tree" else FileError("x", "no file")

    monkeypatch.setattr(recorded, "parse_tree" if lost == "tree" else "load_scene", refuse)
    flight = RecordedFlight(flown.record, to_s=0.5)
    flight.save(tmp_path / "flight.rrd")
    assert (flight.tree is None) == (lost == "tree")
    assert (flight.facts.lab_map is None) == (lost == "lab")
    assert len(flight.facts.nodes) > 5


def test_a_part_without_a_tick_is_refused_and_a_cut_record_is_shown_as_far_as_it_goes(
    flown: Seen, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match="no tick"):
        RecordedFlight(flown.record, from_s=500.0).save(tmp_path / "flight.rrd")
    assert list(tmp_path.iterdir()) == []
    whole, cut = flown.record.read_bytes(), tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    flight = RecordedFlight(cut)
    flight.save(tmp_path / "cut.rrd")
    assert flight.damages[0] == "it was never finished"
    assert "/world/path" in contents(tmp_path / "cut.rrd")


def test_nobody_draws_for_a_viewer_that_was_closed(flown: Seen) -> None:
    import rerun as rr

    steps: list[int] = []
    RecordedFlight(flown.record).draw(
        rr.RecordingStream("test"),
        advance=lambda _, done, __: steps.append(done),
        stopped=lambda: len(steps) == 3,
    )
    assert steps == [1, 2, 3]


def test_a_flight_is_drawn_while_it_is_flown(tmp_path: Path) -> None:
    with saved_view(tmp_path / "live.rrd", title="tour") as view:
        app.fly(tree_file(tmp_path, MISSION), OPTIONS, listeners=[view])
    told = contents(tmp_path / "live.rrd")
    assert all(entity in told for entity in ENTITIES)


# --- what a film is told of a flight --------------------------------------------------------------

SCENE = Scene(
    name="small",
    helipad=Helipad(position_m=(-1.5, -1.0), yaw_deg=90.0),
    objects=(
        ObjectSpec(kind="box-3", position_m=(1.0, 0.5), size_m=(0.4, 0.3, 1.9), yaw_deg=20.0),
    ),
    movers=(MoverSpec(path_m=((0.0, -1.0), (0.0, 1.0), (-1.0, 1.0)), speed_mps=0.5, loop=True),),
)


def flight_of(**options: object) -> app.Flight[Drone]:
    drone = ScriptedDrone()
    drone.scene = SCENE
    flight = app.assemble("land_only", drone=drone)
    return replace(flight, options=app.FlightOptions(**options))


def test_a_scene_becomes_a_map_in_the_colours_of_its_classes() -> None:
    lab = film.facts_of_flight(flight_of(), "").lab_map
    assert lab.ground.size_m == (5.0, 4.0)
    (box,), (mover,) = lab.boxes, lab.movers
    assert (box.x_m, box.y_m, box.height_m) == (1.0, 0.5, 1.9)
    assert np.allclose(box.corners(), SCENE.placed[0].footprint.corners())
    assert box.colour == tuple(CLASSES.colours[CLASSES.id_of("box_3")])
    assert (lab.mark.x_m, lab.mark.y_m, lab.mark.height_m) == (-1.5, -1.0, 0.4)
    assert mover.round
    assert mover.path_m == ((0.0, -1.0), (0.0, 1.0), (-1.0, 1.0), (0.0, -1.0))
    assert mover.colour == tuple(CLASSES.colours[CLASSES.id_of("box_8")])
    assert (box.name, mover.name) == ("box_3", "box_8")
    assert start_of(TakeOffSpec(yaw_deg=90.0)) == Pose2D(x_m=-1.5, y_m=-1.0, yaw_rad=math.pi / 2)
    assert start_of(TakeOffSpec(position_m=(1.0, 1.5))) == Pose2D(x_m=1.0, y_m=1.5, yaw_rad=0.0)
    assert start_of(TakeOffSpec(random=True)) is None


def start_of(take_off: TakeOffSpec) -> Pose2D | None:
    """Return where the drone starts, by the map of the scene."""
    return film.map_of_scene(replace(SCENE, movers=(), take_off=take_off)).take_off


def test_the_map_of_a_lab_with_kinds_has_their_outlines_and_parts() -> None:
    lab = film.map_of_scene(load_scene("depot-train-a"))
    by_name = {box.name: box for box in lab.boxes}
    assert set(by_name) == {"rack", "table", "drum", "crate", "barrier"}
    assert len(by_name["drum"].corners()) > 4
    assert len(by_name["table"].parts) == 5
    assert by_name["crate"].parts == by_name["crate"].pieces_m == ()
    assert len(by_name["barrier"].pieces_m) >= 1
    assert lab.mark is not None
    assert lab.mark.picture is not None
    assert lab.ground.corners_m[0] == (4.0, 3.0)


def test_a_film_names_mission_scene_and_seed_unless_it_is_given_a_title() -> None:
    # The title has the name that is written in the scene file.
    flight = flight_of(scene="labs/a file.yaml", seed=7)
    assert film.facts_of_flight(flight).title == "land_only in small, seed 7"
    assert film.facts_of_flight(flight, "a tour").title == "a tour"


def test_a_flight_that_fails_leaves_its_status() -> None:
    console = Console(file=(out := io.StringIO()), force_terminal=False, width=120)
    with suppress(RuntimeError), film.live_status(console) as status:
        (listener,) = status(flight_of())
        listener.on_tick(World().tick())
        raise RuntimeError("a leaf raised")
    assert out.getvalue().startswith("explore")


SECOND_LEVEL = document(
    '<Sequence><Segment/><EstimateDepth model="contact"/><BuildCorridor side_m="0.4"/><Land/>'
    "</Sequence>"
)


def test_the_film_shows_the_depth_and_the_corridor_that_the_tree_asks_for() -> None:
    camera = ScriptedDrone().camera
    frame = values.frame((36, 64), 0.0)
    depth = DepthMap(depth=np.full((28, 56), 1.0, np.float32), metric=True, captured_s=0.0)
    ids = paper_map(ids=np.full((28, 56), CLASSES.id_of("box_1"), np.uint8), captured_s=0.0)
    marked = {}
    for side_m in ("0.4", "0.2"):
        tree = parse_tree(SECOND_LEVEL.replace("0.4", side_m))
        facts = film.facts_of(tree, camera, classes=CLASSES)
        assert facts.makes_depth
        marked[side_m] = int(facts.intruding(frame, ids, depth).sum())
    assert 0 < marked["0.2"] < marked["0.4"]
    tree = parse_tree(document("<Sequence><Segment/><Land/></Sequence>"))
    facts = film.facts_of(tree, camera, classes=CLASSES)
    assert (facts.makes_depth, facts.intruding) == (False, None)
