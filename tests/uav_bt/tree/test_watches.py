"""Watchers of nodes: the order of events, leaves that block, and branches that fail."""

from __future__ import annotations

import logging
from typing import ClassVar

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import World
from uav_bt.board import ELAPSED
from uav_bt.clock import ManualClock
from uav_bt.errors import NodeFailedError
from uav_bt.testing import parse_tree
from uav_bt.tree import Leaf, MissionTree, Port, Status
from uav_bt.tree.nodes import AlwaysSuccess, Sequence
from uav_bt.tree.watches import BranchEnds, BranchWatch, BudgetWatch, SlowLeaf

# --- leaves that block ----------------------------------------------------------------------------


class Blocks(Leaf):
    """Advances the test's wall clock in a configured method."""

    ports = (
        Port("blocks", str, default="", doc="in which method"),
        Port("for_s", float, default=1.0, doc="seconds"),
        Port("raises", bool, default=False, doc="and then raises"),
    )
    wall: ClassVar[ManualClock]

    def _block(self, method: str) -> None:
        if self.port_value("blocks") == method:
            self.wall.advance(self.port_value("for_s"))
            if self.port_value("raises"):
                raise OSError("timed out")

    def initialise(self) -> None:
        self._block("initialise")

    def update(self) -> Status:
        self._block("update")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        del new_status
        self._block("terminate")


class MayTakeLonger(Blocks):
    """Has a larger budget."""

    budget_s = 2.0


@pytest.fixture
def wall() -> ManualClock:
    Blocks.wall = ManualClock()
    return Blocks.wall


def watched(world: World, wall: ManualClock, *leaves: Leaf) -> tuple[MissionTree, BudgetWatch]:
    tree = MissionTree(Sequence("s", leaves), name="Mission")
    tree.setup(world.context)
    return tree, BudgetWatch(tree, timer=wall.now)


@pytest.mark.parametrize("method", ["initialise", "update", "terminate"])
def test_whichever_method_blocks_the_leaf_is_named(
    world: World, wall: ManualClock, method: str, caplog: pytest.LogCaptureFixture
) -> None:
    tree, watch = watched(world, wall, AlwaysSuccess(), Blocks("b", blocks=method))
    with caplog.at_level(logging.WARNING):
        tree.tick()
        tree.halt()
    assert watch.take() == (SlowLeaf(path="Mission/s/b", took_s=1.0, budget_s=0.5),)
    assert watch.take() == ()
    (message,) = caplog.messages
    assert message == (
        "leaf 'Mission/s/b' blocked for 1.00 s, its budget is 0.50 s: "
        "it must answer at once and go on in the next tick"
    )


def test_within_the_budget_no_warning_is_given(world: World, wall: ManualClock) -> None:
    for one in (MayTakeLonger(blocks="update"), Blocks(blocks="update", for_s=0.5)):
        tree, watch = watched(world, wall, one)
        tree.tick()
        assert watch.take() == ()


def test_a_leaf_that_blocks_and_raises_is_named_for_both(world: World, wall: ManualClock) -> None:
    tree, watch = watched(world, wall, Blocks("b", blocks="update", raises=True))
    with pytest.raises(NodeFailedError, match="'Mission/s/b' failed: OSError: timed out"):
        tree.tick()
    assert watch.worst_s == {"Mission/s/b": 1.0}


# --- branches that fail ---------------------------------------------------------------------------

ROOT = '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'
BRANCHES = cases("branches")


@pytest.mark.parametrize(("text", "mocks", "ticks", "causes", "ended"), BRANCHES)
def test_causes_of_failures(
    text: str, mocks: dict[str, str], ticks: int, causes: list[list[str]], ended: str | None
) -> None:
    bench = parse_tree(ROOT.format(text), mocks=mocks)
    watch, found = BranchWatch(bench.tree), []
    ends = BranchEnds()
    for _ in range(ticks):
        bench.tick()
        ends = watch.take()
        found.append([node.path for node in ends.failed])
    assert found == causes
    assert (None if ends.ended is None else ends.ended.path) == ended


def test_a_leaf_that_is_skipped_while_it_runs_did_not_fail() -> None:
    tree = '<Fallback name="f"><HoverFor _while="@elapsed_s &lt; 1"/><Turn degrees="9"/></Fallback>'
    bench = parse_tree(ROOT.format(tree), mocks={"HoverFor": "R", "Turn": "R"})
    watch = BranchWatch(bench.tree)
    for elapsed_s in (0.5, 1.5):
        bench.board[ELAPSED] = elapsed_s
        bench.tick()
        assert watch.take() == BranchEnds()
    bench.log.assert_halted("HoverFor", times=1)
