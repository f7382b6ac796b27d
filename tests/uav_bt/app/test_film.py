"""Displays of a flight: their data about the lab, and their composition."""

import io
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from rich.console import Console

from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from tests.paper_lab import CLASSES, paper_map
from tests.worlds import values
from uav_bt import app
from uav_bt.app import film
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Status, load_tree
from uav_bt.types import HOVER, DepthMap, Pose2D

SCENE = Scene(
    name="small",
    helipad=Helipad(position_m=(-1.5, -1.0), yaw_deg=90.0),
    boxes=(BoxSpec(pattern=3, position_m=(1.0, 0.5), size_m=(0.4, 0.3, 1.9), yaw_deg=20.0),),
    movers=(MoverSpec(path_m=((0.0, -1.0), (0.0, 1.0), (-1.0, 1.0)), speed_mps=0.5, loop=True),),
)


class SceneDrone(ScriptedDrone):
    """Replaces the twin: a drone with a scene."""

    def __init__(self) -> None:
        super().__init__()
        self.scene = SCENE


def flight_of(drone: ScriptedDrone, tree: Path | str = "land_only") -> app.Flight[ScriptedDrone]:
    return app.Flight(app.check(tree), drone, app.FlightOptions())


def ticks(drone: ScriptedDrone, listeners: Sequence[TickListener], count: int) -> None:
    for index in range(count):
        record = TickRecord(
            index=index,
            time_s=drone.clock.now(),
            observation=drone.observe(),
            tree_status=Status.RUNNING,
            phase="explore",
            active=("mission", "Explore"),
            command=HOVER,
            proposed_by=None,
            override=None,
            compute_s=0.0,
            truth=None,
        )
        for listener in listeners:
            listener.on_tick(record)
        drone.clock.advance(0.1)


def test_a_scene_becomes_a_map_in_the_colours_of_its_classes() -> None:
    lab = film.lab_map_of(SceneDrone())
    assert lab.ground_size_m == (5.0, 4.0)
    (box,) = lab.boxes
    assert (box.x_m, box.y_m, box.size_m) == (1.0, 0.5, (0.4, 0.3, 1.9))
    assert box.yaw_rad == pytest.approx(math.radians(20))
    assert box.colour == tuple(CLASSES.colours[CLASSES.id_of("box_3")])
    assert np.allclose(box.corners(), SCENE.boxes[0].footprint.corners())
    assert (lab.mark.x_m, lab.mark.y_m) == (-1.5, -1.0)
    (mover,) = lab.movers
    assert mover.item.round
    assert mover.path_m == ((0.0, -1.0), (0.0, 1.0), (-1.0, 1.0), (0.0, -1.0))
    assert mover.item.colour == tuple(CLASSES.colours[CLASSES.id_of("box_8")])
    assert (box.name, mover.item.name) == ("box_3", "box_8")


def test_the_map_of_a_lab_with_kinds_has_their_outlines_and_parts() -> None:
    scene = load_scene("depot-train-a")
    lab = film.map_of_scene(scene)
    by_name = {box.name: box for box in lab.boxes}
    assert set(by_name) == {"rack", "table", "drum", "crate", "barrier"}
    assert len(by_name["drum"].corners()) > 4
    assert len(by_name["table"].parts) == 5
    assert by_name["crate"].parts == ()
    assert lab.ground == scene.ground_plan
    assert lab.outline()[0] == (4.0, 3.0)


@pytest.mark.parametrize(
    ("take_off", "expected"),
    [
        (TakeOffSpec(yaw_deg=90.0), Pose2D(x_m=-1.5, y_m=-1.0, yaw_rad=math.pi / 2)),
        (TakeOffSpec(position_m=(0.0, 0.0)), Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)),
        (TakeOffSpec(random=True), None),
    ],
    ids=["from the mark", "from a point", "random"],
)
def test_the_map_has_the_take_off_pose(take_off: TakeOffSpec, expected: Pose2D | None) -> None:
    scene = replace(SCENE, movers=(), take_off=take_off)
    assert film.map_of_scene(scene).take_off == expected


def test_a_drone_that_knows_no_scene_has_no_map() -> None:
    assert film.lab_map_of(ScriptedDrone()) is None


def first_image(path: Path, options: app.FlightOptions, title: str = "") -> np.ndarray:
    drone = SceneDrone()
    with film.flight_video(path, title=title) as video:
        ticks(drone, video(app.Flight(app.check("land_only"), drone, options)), 1)
    with av.open(str(path)) as container:
        return next(container.decode(video=0)).to_ndarray(format="rgb24")


def test_a_film_names_mission_scene_and_seed_unless_it_is_given_a_title(tmp_path: Path) -> None:
    # The title has the name that is written in the scene file.
    options = app.FlightOptions(scene="labs/a file.yaml", seed=7)
    named = first_image(tmp_path / "named.mp4", options)
    said = first_image(tmp_path / "said.mp4", options, "land_only in small, seed 7")
    other = first_image(tmp_path / "other.mp4", options, "a tour")
    assert (named == said).all()
    assert (named != other).any()


def test_the_timeline_of_a_film_ends_at_the_limit_of_the_flight(tmp_path: Path) -> None:
    long, short = (
        first_image(tmp_path / "f.mp4", app.FlightOptions(judge=JudgeConfig(time_limit_s=limit_s)))
        for limit_s in (300.0, 20.0)
    )
    differs = np.argwhere((long != short).any(axis=2))
    assert differs.size > 0
    assert differs.min(axis=0).tolist() >= [660, 640]


def test_a_flight_that_never_begins_leaves_no_video(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), film.flight_video(tmp_path / "flight.mp4"):
        raise RuntimeError("the tree was refused")
    assert list(tmp_path.iterdir()) == []


def test_a_flight_is_filmed_and_reported_at_once(tmp_path: Path) -> None:
    drone, out = SceneDrone(), io.StringIO()
    console = Console(file=out, force_terminal=False, width=120)
    with (
        film.flight_video(tmp_path / "flight.mp4") as video,
        film.live_status(console) as status,
    ):
        flight = flight_of(drone)
        ticks(drone, [*video(flight), *status(flight)], 2)
        assert not (tmp_path / "flight.mp4").exists()
    with av.open(str(tmp_path / "flight.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 2
    assert out.getvalue().startswith("explore")


SECOND_LEVEL = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
<Segment/><EstimateDepth model="contact"/><BuildCorridor side_m="0.4"/><Land/>
</Sequence></BehaviorTree></root>"""


def test_the_film_shows_the_depth_and_the_corridor_that_the_tree_asks_for(tmp_path: Path) -> None:
    path, camera = tmp_path / "mission.xml", ScriptedDrone().camera
    frame = values.frame((36, 64), 0.0)
    depth = DepthMap(depth=np.full((28, 56), 1.0, np.float32), metric=True, captured_s=0.0)
    ids = paper_map(ids=np.full((28, 56), CLASSES.id_of("box_1"), np.uint8), captured_s=0.0)
    marked = {}
    for side_m in ("0.4", "0.2"):
        path.write_text(SECOND_LEVEL.replace("0.4", side_m), encoding="utf-8")
        shown = film.depth_of(load_tree(path), camera)
        assert shown["makes_depth"]
        marked[side_m] = int(shown["intruding"](frame, ids, depth).sum())
    assert 0 < marked["0.2"] < marked["0.4"]
    path.write_text(re.sub("<EstimateDepth.*/>", "", SECOND_LEVEL), encoding="utf-8")
    assert film.depth_of(load_tree(path), camera) == {"makes_depth": False, "intruding": None}
