"""Our nodes work with the managers, visitors, renderers and composites of py_trees."""

from __future__ import annotations

import py_trees
import pytest
from py_trees.common import Status

from tests.conformance import Scripted
from tests.worlds.trees import World, leaf
from uav_bt.board import MissionContext
from uav_bt.errors import MissionError
from uav_bt.tree import MissionTree

BODY = (
    f"<ReactiveSequence>{leaf('a', 'S')}<Inverter>{leaf('b', 'F')}</Inverter>"
    f"{leaf('c', 'RS')}</ReactiveSequence>"
)


def test_visitors_see_each_tick(world: World) -> None:
    """A snapshot shows the answers of all nodes in the tick, also of nodes reset since."""
    tree = world.tree(BODY)
    manager = py_trees.trees.BehaviourTree(tree.root)
    snapshot = py_trees.visitors.SnapshotVisitor()
    manager.visitors.append(snapshot)
    manager.tick()
    by_name = {node.name: snapshot.visited.get(node.id) for node in tree.nodes()}
    assert by_name == {
        "ReactiveSequence": Status.RUNNING,
        "a": Status.SUCCESS,
        "Inverter": Status.SUCCESS,
        "b": Status.FAILURE,
        "c": Status.RUNNING,
    }
    manager.tick()
    assert tree.root.status is Status.SUCCESS
    manager.tick()
    assert tree.root.status is Status.SUCCESS


def test_manager_sets_up_and_interrupts(world: World) -> None:
    """`BehaviourTree.setup(mission=...)` sets our nodes up; stopping the root halts them."""
    tree = MissionTree(Scripted("a", script="R"))
    manager = py_trees.trees.BehaviourTree(tree.root)
    manager.setup(mission=world.context)
    manager.tick()
    manager.root.stop(Status.INVALID)
    assert world.events() == ["start a", "halt a"]


def test_a_plain_tree_is_set_up_with_two_lines_that_its_error_says() -> None:
    """The test executes the two lines of the error's text."""
    leaf_there = Scripted("a", script="RS")
    behaviour_tree = py_trees.trees.BehaviourTree(
        py_trees.decorators.Inverter("not", child=leaf_there)
    )
    with pytest.raises(MissionError, match="node 'a': setup needs") as caught:
        behaviour_tree.setup()
    first, second = (line.strip() for line in str(caught.value).splitlines()[1:])
    assert first == "from uav_bt.board import MissionContext"
    assert second == "behaviour_tree.setup(mission=MissionContext())"
    behaviour_tree.setup(mission=MissionContext())
    behaviour_tree.tick()
    behaviour_tree.tick()
    assert behaviour_tree.root.status is Status.FAILURE


def test_renderers_draw(world: World) -> None:
    """The text rendering of py_trees shows our nodes."""
    text = py_trees.display.unicode_tree(world.tree(BODY).root)
    assert [line.split()[-1] for line in text.strip().splitlines()] == [
        "ReactiveSequence",
        "a",
        "Inverter",
        "b",
        "c",
    ]


def test_our_leaves_work_under_py_trees_composites(world: World) -> None:
    """Nodes of py_trees tick, restart and stop our leaves like any behaviour."""
    first, second = Scripted("a", script="S"), Scripted("b", script="RSR")
    for node in (first, second):
        node.setup(mission=world.context)
    root = py_trees.composites.Sequence("s", memory=True, children=[first, second])
    for expected in (Status.RUNNING, Status.SUCCESS, Status.RUNNING):
        root.tick_once()
        assert root.status is expected
    root.stop(Status.INVALID)
    assert world.events() == [
        "start a",
        "start b",
        "running b",
        "start a",
        "start b",
        "halt b",
    ]
