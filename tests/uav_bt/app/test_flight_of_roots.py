"""Trees built in Python, flown by their root: of py_trees, or of nodes of this package."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import py_trees
import pytest

from behaviours.fly.land import Land
from behaviours.fly.look import HoverFor
from behaviours.fly.take_off import TakeOff
from uav_bt import app
from uav_bt.app.replay import ReplayOptions, replay
from uav_bt.board import STATE
from uav_bt.board.context import MissionContext
from uav_bt.campaign import make_plan
from uav_bt.errors import FileError, InputError
from uav_bt.testing import ScriptedDrone
from uav_bt.tree.nodes import Sequence

ANYWHERE = app.JudgeConfig(land_on=app.LandOn.ANY)


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


def test_a_tree_of_py_trees_flies_and_the_report_names_it(tmp_path: Path) -> None:
    heights, report = Heights(), tmp_path / "report.json"
    flown = app.fly(hop(heights), drone="plain", judge=ANYWHERE, seed=1, report=report)
    assert flown.outcome == "success"
    assert flown.tree == "hop (composed in Python)"
    assert json.loads(report.read_text(encoding="utf-8"))["tree"] == flown.tree
    assert max(heights.seen_m) > 0.9
    assert flown.events[-1].text == "the tree succeeded at Land"
    assert flown.events[-1].node == "hop/hop/Land"


def test_a_node_as_root_flies_the_same_flight() -> None:
    root = Sequence("hop", [TakeOff(height_m=1.2), HoverFor(seconds=1.0), Land()])
    flown = app.fly(root, drone="plain", judge=ANYWHERE, seed=1)
    assert flown.tree == "hop (composed in Python)"
    assert np.array_equal(flown.path, app.fly(hop(), drone="plain", judge=ANYWHERE, seed=1).path)
    with pytest.raises(InputError, match="tree 'hop' was flown or set up before"):
        app.fly(root, drone="plain", judge=ANYWHERE, seed=1)


def test_a_replay_is_given_the_tree_again(tmp_path: Path) -> None:
    record = tmp_path / "hop.mcap"
    app.fly(hop(), drone=ScriptedDrone(), judge=ANYWHERE, record=record)
    with pytest.raises(FileError, match=r"lacks its tree file \(hop \(composed in Python\)\)"):
        replay(record)
    again = replay(record, ReplayOptions(tree=hop()))
    assert again.same
    assert again.tree == "hop (composed in Python)"


def test_what_needs_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="watch: expected a tree file"):
        app.fly(hop(), drone="plain", judge=ANYWHERE, watch=print)
    with pytest.raises(InputError, match=r"a campaign flies tree files, .*; got <py_trees"):
        make_plan([hop()])
    with pytest.raises(InputError, match="variables: for tree files only; 'hop' is loaded already"):
        app.check(hop(), variables={"laps": 3})
    with pytest.raises(InputError, match="tree_folders: for tree files only"):
        app.check(hop(), tree_folders=app.TreeFolders(trees=[tmp_path]))


def test_a_port_of_a_leaf_is_set_by_its_name() -> None:
    tree = app.check(hop(), ports={"TakeOff.height_m": 1.7})
    assert tree.find("hop/hop/TakeOff").literals["height_m"] == 1.7
