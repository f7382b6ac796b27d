"""Films of a flight: their data about the lab, and their composition."""

import io
import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from rich.console import Console

from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.display.display_world import World
from tests.worlds import values
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app import film
from uav_bt.protocols import Drone
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import parse_tree
from uav_bt.types import DepthMap, Pose2D

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
    assert by_name["crate"].parts == ()
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
