"""The recorder: transitions in the order of BehaviorTree.CPP, and a clean detachment."""

from __future__ import annotations

import pytest

from tests.uav_bt.groot.groot_world import make_context, make_tree
from tests.worlds.tables import cases
from tests.worlds.trees import leaf
from uav_bt.clock import ManualClock
from uav_bt.errors import NodeFailedError
from uav_bt.groot.transitions import TransitionRecorder, TreeNumbering
from uav_bt.tree import MissionTree


def watched(body: str, *more: str) -> tuple[MissionTree, TransitionRecorder]:
    tree = make_tree(body, *more)
    clock = ManualClock()
    tree.setup(make_context(clock))
    return tree, TransitionRecorder(TreeNumbering(tree), clock)


def taken(recorder: TransitionRecorder) -> str:
    """Return the recorded transitions as `1R 2S`: uid and status."""
    return " ".join(f"{uid}{status.letter}" for _, uid, status in recorder.take())


@pytest.mark.parametrize(("body", "ticks"), cases("groot"))
def test_transitions_come_in_the_order_of_the_engine(body: str, ticks: str) -> None:
    tree, recorder = watched(body)
    *told, halt = ticks.split(", ")
    for one in told:
        tree.tick()
        assert taken(recorder) == one
    tree.halt()
    assert taken(recorder) == halt


def test_a_node_that_raises_leaves_everything_idle() -> None:
    tree, recorder = watched(f"<Sequence>{leaf('a', 'S')}{leaf('b', '')}</Sequence>")
    with pytest.raises(NodeFailedError, match="IndexError"):
        tree.tick()
    assert taken(recorder) == "1R 2S 3R 2I 3I 1I"
