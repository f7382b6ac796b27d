"""A tree of py_trees as the root of a mission."""

from __future__ import annotations

import logging
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status as Theirs

from uav_bt.board import HEIGHT
from uav_bt.errors import InputError, NodeFailedError
from uav_bt.testing import TreeBench
from uav_bt.tree import Leaf, MissionTree, Status
from uav_bt.tree.nodes import Sequence
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.types import Hover


class Climb(Leaf):
    """Waits until it is high enough."""

    moves = True
    reads = (HEIGHT,)

    def update(self) -> Status:
        self.propose(Hover())
        return Status.SUCCESS if (self.read(HEIGHT).value or 0.0) > 1.5 else Status.RUNNING


class Notes(Behaviour):
    """Keeps what py_trees calls."""

    def __init__(self, name: str, answer: Any = Theirs.SUCCESS) -> None:
        super().__init__(name)
        self.answer = answer
        self.calls: list[str] = []
        self.given: dict[str, Any] = {}

    def setup(self, **kwargs: Any) -> None:
        self.given = kwargs
        self.calls.append("setup")

    def initialise(self) -> None:
        self.calls.append("initialise")

    def update(self) -> Theirs:
        if isinstance(self.answer, Exception):
            raise self.answer
        answer: Theirs = self.answer
        return answer

    def terminate(self, new_status: Theirs) -> None:
        self.calls.append(f"terminate {new_status.name}")

    def shutdown(self) -> None:
        self.calls.append("shutdown")


def sequence(*children: Behaviour | Leaf | Sequence, memory: bool = True) -> Behaviour:
    return py_trees.composites.Sequence("patrol", memory=memory, children=list(children))


def test_nodes_of_ours_are_the_nodes_of_the_tree() -> None:
    climb, below = Climb("up"), ScriptedLeaf("says", "S")
    root = sequence(py_trees.decorators.Inverter("not", climb), Sequence("both", [below]))
    tree = MissionTree(root, name="Patrol")
    assert [node.path for node in tree.nodes()] == [
        "Patrol/patrol",
        "Patrol/patrol/up",
        "Patrol/patrol/both",
        "Patrol/patrol/both/says",
    ]
    assert list(tree.leaves()) == [climb, below]
    assert climb.has_parent_with_name("not")  # as py_trees has it


def test_leaves_propose_and_events_name_them() -> None:
    notes = Notes("notes")
    bench = TreeBench(MissionTree(sequence(Climb("up"), notes)))
    bench.hover(height_m=1.0)
    assert bench.tick() is Status.RUNNING
    assert bench.outcomes[-1].proposed_by == "Tree/patrol/up"
    assert bench.tree.active_path() == ("patrol", "up")
    assert "initialise" not in notes.calls
    bench.hover(height_m=2.0)
    assert bench.tick() is Status.SUCCESS
    bench.log.assert_order("up started", "up succeeded", "patrol succeeded")
    assert notes.given == {"mission": bench.tree.root.mission}
    bench.tree.shutdown()
    bench.tree.shutdown()
    assert notes.calls == ["setup", "initialise", "terminate SUCCESS", "shutdown"]


def test_a_branch_that_is_left_is_halted_by_py_trees() -> None:
    high = ScriptedLeaf("high", "FFS")
    up, notes = ScriptedLeaf("up", "R"), Notes("notes", Theirs.RUNNING)
    both = py_trees.composites.Parallel(
        "both", py_trees.common.ParallelPolicy.SuccessOnAll(), children=[up, notes]
    )
    bench = TreeBench(
        MissionTree(py_trees.composites.Selector("root", memory=False, children=[high, both]))
    )
    assert bench.tick_until(Status.SUCCESS, max_ticks=5) == 3
    bench.log.assert_halted("up", tick=3)
    assert notes.calls[-1] == "terminate INVALID"


def test_halting_the_tree_stops_both_kinds() -> None:
    up, notes = ScriptedLeaf("up", "R"), Notes("notes", Theirs.RUNNING)
    both = py_trees.composites.Parallel(
        "both", py_trees.common.ParallelPolicy.SuccessOnAll(), children=[up, notes]
    )
    bench = TreeBench(MissionTree(both))
    bench.tick()
    bench.halt()
    bench.log.assert_halted("up")
    assert notes.calls == ["setup", "initialise", "terminate INVALID"]
    assert both.status is Theirs.INVALID
    assert bench.tree.active_path() == ()
    assert bench.tick() is Status.RUNNING


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (OSError("gone"), r"node 'Tree/patrol' failed: OSError: gone"),
        (None, r"update\(\) of Notes must return a status of py_trees, got INVALID or another"),
        (Theirs.INVALID, r"update\(\) of Notes must return a status of py_trees"),
    ],
)
def test_what_raises_halts_the_others(answer: object, message: str) -> None:
    up = ScriptedLeaf("up", "R")
    both = py_trees.composites.Parallel(
        "patrol", py_trees.common.ParallelPolicy.SuccessOnAll(), children=[up, Notes("n", answer)]
    )
    bench = TreeBench(MissionTree(both))
    with pytest.raises(NodeFailedError, match=message):
        bench.tick()
    bench.log.assert_halted("up")


def test_a_leaf_that_raises_is_named_by_its_own_path() -> None:
    class Breaks(Leaf):
        """Loses its sensor."""

        def update(self) -> Status:
            raise OSError("gone")

    with pytest.raises(NodeFailedError, match="node 'Tree/patrol/Breaks' failed"):
        TreeBench(MissionTree(sequence(Breaks()))).tick()


def test_a_single_behaviour_may_be_the_root() -> None:
    notes = Notes("notes", Theirs.FAILURE)
    assert TreeBench(MissionTree(notes)).tick() is Status.FAILURE


def test_a_failing_shutdown_does_not_keep_the_others_open() -> None:
    class Stuck(Notes):
        """Cannot be shut down."""

        def shutdown(self) -> None:
            raise OSError("stuck")

    notes = Notes("notes")
    bench = TreeBench(MissionTree(sequence(Stuck("stuck"), notes)))
    bench.setup()
    with pytest.raises(NodeFailedError, match="node 'Tree/patrol' failed: OSError: stuck"):
        bench.tree.shutdown()
    assert notes.calls == ["setup", "shutdown"]


def test_a_timer_of_py_trees_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        TreeBench(MissionTree(sequence(py_trees.timers.Timer("rest", 1.0)))).setup()
    assert "'Timer' of py_trees measures the computer's clock" in caplog.text


def test_a_part_of_a_tree_is_no_root() -> None:
    inner = py_trees.behaviours.Success("inner")
    sequence(inner)
    with pytest.raises(InputError, match="'inner' stands below 'patrol': give the root"):
        MissionTree(inner)
