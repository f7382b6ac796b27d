"""Flights of Python objects: leaves, policies, drones and trees without a package."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import py_trees
import pytest

from behaviours.fly.land import Land
from behaviours.fly.look import HoverFor
from behaviours.fly.take_off import TakeOff
from behaviours.policies.segmentation_rule import SegmentationRule
from sim_bridge.twin import TwinConfig
from tests.worlds.records import ANYWHERE
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.answers import Advance, Answer
from uav_bt.app.replay import ReplayOptions, replay
from uav_bt.board import STATE
from uav_bt.board.context import MissionContext
from uav_bt.campaign import make_plan
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.mission.flight_report import FlightReport
from uav_bt.protocols import PolicyView
from uav_bt.record.reader import RecordReader
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, load_tree
from uav_bt.tree.nodes import Sequence
from uav_bt.types import Hover


class Peek(Leaf):
    """Hover for some ticks."""

    ports = (Port("ticks", int, default=3, doc="how many ticks"),)

    def initialise(self) -> None:
        self._left = self.port_value("ticks")

    def update(self) -> Status:
        self._left -= 1
        self.propose(Hover())
        return Status.RUNNING if self._left > 0 else Status.SUCCESS


class Careful:
    """Half the steps of the shipped rule."""

    def __init__(self) -> None:
        self.rule = SegmentationRule()
        self.asked = 0

    def decide(self, view: PolicyView) -> Answer:
        self.asked += 1
        answer = self.rule.decide(view)
        if isinstance(answer, Advance):
            return replace(answer, forward_m=answer.forward_m / 2.0)
        return answer


MISSION = """
<root BTCPP_format="4"><BehaviorTree ID="Tour">
  <ReactiveSequence>
    <Segment/> <FindMark/> <TrackMotion/> <MapSite/>
    <Sequence>
      <TakeOff height_m="1.2"/> <Peek ticks="2"/>
      <Fallback> <Explore/> <Avoid/> </Fallback>
      <Land/>
    </Sequence>
  </ReactiveSequence>
</BehaviorTree></root>
"""
TWIN = TwinConfig(scene="val-a", seed=3, image_size_px=(320, 180))
NODES = NodeRegistry.installed().with_nodes(Peek)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightReport, Careful, Path]:
    """Fly a tree's text with an own leaf, an own policy and a configured twin; record it."""
    policy, record = Careful(), tmp_path_factory.mktemp("objects") / "flight.mcap"
    options = app.FlightOptions(
        drone=TWIN,
        seed=3,
        exact_masks=True,
        policies={"Explore": policy},
        judge=ANYWHERE,
        record=str(record),
    )
    return app.fly(MISSION, options, registry=NODES), policy, record


def test_report_and_record_say_what_flew(flown: tuple[FlightReport, Careful, Path]) -> None:
    report, policy, record = flown
    assert (report.outcome, report.reason) == ("success", "landed")
    assert policy.asked > 0
    assert (report.tree, report.drone) == ("<text>", "sim_bridge.twin.TwinConfig")
    assert (report.scene, report.profile, report.seed) == ("val-a", "lab", 3)
    body = "Tour/ReactiveSequence/Sequence/Fallback"
    assert report.policies == {
        f"{body}/Explore": f"{__name__}.Careful",
        f"{body}/Avoid": "segmentation",
    }
    reader = RecordReader(record)
    known = reader.metadata
    assert (known["tree"], known["drone"]) == ("<text>", "sim_bridge.twin.TwinConfig")
    assert known["drone_config"] == repr(TWIN)
    assert json.loads(known["policies"]) == {"Explore": f"{__name__}.Careful"}
    assert reader.attachments["tree/<text>"].data == MISSION.encode()


def test_a_replay_is_given_the_objects_again(flown: tuple[FlightReport, Careful, Path]) -> None:
    options = ReplayOptions(policies={"Explore": Careful()}, registry=NODES)
    report = replay(str(flown[2]), options)
    assert report.same
    assert report.tree == "<text>"
    other = replay(flown[2], replace(options, policies={"Explore": "segmentation"}))
    assert not other.same  # twice the steps
    with pytest.raises(InputError, match=r"unknown policy '.*Careful'"):
        replay(flown[2], ReplayOptions(registry=NODES))
    with pytest.raises(TreeError, match="unknown node 'Peek'"):
        replay(flown[2], replace(options, registry=None))


def test_options_and_site_replace_attributes_of_a_tree_object() -> None:
    tree = app.check("explore_and_land_segmentation")
    policy = Careful()
    options = app.FlightOptions(
        policies={"Explore": policy}, site=app.Site(flight_height_m=1.1, model="teacher")
    )
    flight = app.assemble(tree, options)
    assert flight.mission is tree
    values = {leaf.node_id: leaf for leaf in tree.leaves()}
    assert values["TakeOff"].port_value("height_m") == 1.1
    assert values["Segment"].port_value("model") == "teacher"
    assert flight.context.policy(values["Explore"].port_value("policy")) is policy
    assert tree.replaced[values["Explore"].path] == {"policy": f"{__name__}.Careful"}


def scripted(**options: object) -> app.FlightOptions:
    return app.FlightOptions(drone=ScriptedDrone(), judge=ANYWHERE, **options)  # type: ignore[arg-type]


def test_what_was_replaced_in_a_loaded_tree_is_replayed(tmp_path: Path) -> None:
    """The file alone would give a different flight."""
    file, record = tmp_path / "hop.xml", tmp_path / "flight.mcap"
    body = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="0.3"/><Land/></Sequence>'
    file.write_text(document(body), encoding="utf-8")
    tree = load_tree(file, overrides={"TakeOff": {"height_m": "1.9"}, "HoverFor": {"seconds": "1"}})
    app.fly(tree, scripted(record=record))
    assert replay(record).same
    assert not replay(record, ReplayOptions(tree=file)).same


# --- roots of trees -------------------------------------------------------------------------------


class Heights(py_trees.behaviour.Behaviour):
    """Keeps the heights of the flight, from the mission's board."""

    def __init__(self) -> None:
        super().__init__("heights")
        self.seen_m: list[float] = []

    def setup(self, mission: MissionContext) -> None:
        self._board = mission.board

    def update(self) -> py_trees.common.Status:
        state = self._board.read(STATE).value
        if state is not None:
            self.seen_m.append(state.height_m)
        return py_trees.common.Status.SUCCESS


def hop(heights: Heights | None = None) -> py_trees.behaviour.Behaviour:
    """Return a tree of py_trees that takes off, waits and lands."""
    steps = py_trees.composites.Sequence(
        "steps", memory=True, children=[TakeOff(height_m=1.2), HoverFor(seconds=1.0), Land()]
    )
    return py_trees.composites.Parallel(
        "hop",
        py_trees.common.ParallelPolicy.SuccessOnSelected([steps], synchronise=False),
        children=[heights or Heights(), steps],
    )


def test_a_tree_of_py_trees_flies_the_flight_of_its_nodes() -> None:
    heights = Heights()
    flown = app.fly(hop(heights), drone="plain", judge=ANYWHERE, seed=1)
    assert (flown.outcome, flown.tree) == ("success", "hop (composed in Python)")
    assert max(heights.seen_m) > 0.9
    assert flown.events[-1].text == "the tree succeeded at Land"
    assert flown.events[-1].node == "hop/hop/Land"
    root = Sequence("hop", [TakeOff(height_m=1.2), HoverFor(seconds=1.0), Land()])
    same = app.fly(root, drone="plain", judge=ANYWHERE, seed=1)
    assert np.array_equal(flown.path, same.path)
    with pytest.raises(InputError, match="tree 'hop' was flown or set up before"):
        app.fly(root, drone="plain", judge=ANYWHERE, seed=1)


def test_a_tree_of_py_trees_takes_ports_and_a_replay_is_given_it_again(tmp_path: Path) -> None:
    tree, record = app.check(hop(), ports={"TakeOff.height_m": 1.7}), tmp_path / "hop.mcap"
    assert tree.find("hop/hop/TakeOff").literals["height_m"] == 1.7
    app.fly(hop(), scripted(record=record))
    with pytest.raises(FileError, match=r"lacks its tree file \(hop \(composed in Python\)\)"):
        replay(record)
    again = replay(record, ReplayOptions(tree=hop()))
    assert again.same
    assert again.tree == "hop (composed in Python)"


# --- refusals -------------------------------------------------------------------------------------


def composed() -> MissionTree:
    return MissionTree(
        Sequence("body", [TakeOff("up", height_m=1.2), Peek("peek"), Land()]), name="Hop"
    )


LOW = app.Limits(ceiling_m=1.0)
CEILING = r"/up' is to fly at 1\.2 m, above the ceiling of 1 m: lower the flight height"


@pytest.mark.parametrize(
    ("make", "how", "message"),
    [
        (
            str,
            {"options": {"scene": "val-a"}},
            r"options: expected FlightOptions\(\.\.\.\), got \{'",
        ),
        (str, {"registry": [Peek]}, r"registry: expected NodeRegistry.installed.*, got \[<class"),
        (str, {"listeners": [3]}, r"listeners: expected a list of functions, .*, got \[3\]"),
        (str, {"listeners": print}, r"listeners: expected a list of functions, .*, got <built-in"),
        (composed, {"listeners": [print]}, r"listeners: .* that return a list, .*, got None"),
        (composed, {"policies": {"pek": "corridor"}}, "node of that .*; did you mean 'peek'"),
        (composed, {"policies": {"peek": "corridor"}}, "of 'peek': the node has no port 'policy'"),
        (composed, {"site": app.Site(limits=LOW)}, CEILING),
        (composed, {"limits": LOW}, CEILING),
        (hop, {"watch": print}, "watch: expected a tree file"),
        (hop, {"variables": {"laps": 3}}, "variables: for tree files only; 'hop'"),
        (hop, {"tree_folders": app.TreeFolders(trees=["."])}, "tree_folders: for tree files only"),
    ],
)
def test_what_does_not_fit_is_refused_before_the_flight(
    make: Callable[[], Any], how: dict[str, Any], message: str
) -> None:
    drone = ScriptedDrone()
    given = {} if "options" in how else {"drone": drone}
    with pytest.raises(InputError, match=message):
        app.fly(make() or "land_only", **given, **how)
    assert not drone.commands


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        (3, "tree: expected a mission's name, a tree file, its text, or a tree, got 3"),
        (Land, r"tree: expected .*, got the class Land: write Land\(\.\.\.\)"),
        ("<root", "<text>.*not well-formed"),
        ("hoover", "no such tree file"),
    ],
)
def test_what_is_no_mission_is_refused(tree: app.Mission, message: str) -> None:
    for use in (app.check, app.assemble, app.fly):
        with pytest.raises(InputError, match=message):
            use(tree)
    with pytest.raises(InputError, match=r"a campaign flies tree files, .*; got <py_trees"):
        make_plan([hop()])  # type: ignore[list-item]
