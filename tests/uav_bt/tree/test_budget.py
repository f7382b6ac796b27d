"""Leaves that block longer than their budget: found, named, logged and reported."""

from __future__ import annotations

import logging
from typing import ClassVar

import pytest

from tests.worlds.trees import World
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.errors import NodeFailedError
from uav_bt.mission.judge import Judge
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, Port, Status
from uav_bt.tree.budget import BudgetWatch, SlowLeaf
from uav_bt.tree.nodes import AlwaysSuccess, Parallel, Sequence


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
    """It is named with path, time and budget, also in the log."""
    tree, watch = watched(world, wall, AlwaysSuccess(), Blocks("b", blocks=method))
    with caplog.at_level(logging.WARNING):
        tree.tick()
        tree.halt()
    assert watch.take() == (SlowLeaf(path="Mission/s/b", took_s=1.0, budget_s=0.5),)
    assert watch.take() == ()
    (record,) = caplog.records
    assert record.getMessage() == (
        "leaf 'Mission/s/b' blocked for 1.00 s, its budget is 0.50 s: "
        "it must answer at once and go on in the next tick"
    )


def test_within_the_budget_no_warning_is_given(world: World, wall: ManualClock) -> None:
    """The class sets the budget; a time equal to the budget is allowed."""
    for leaf in (MayTakeLonger(blocks="update"), Blocks(blocks="update", for_s=0.5)):
        tree, watch = watched(world, wall, leaf)
        tree.tick()
        assert watch.take() == ()


def test_a_leaf_that_blocks_and_raises_is_named_for_both(world: World, wall: ManualClock) -> None:
    """The exception does not hide the slow call."""
    tree, watch = watched(world, wall, Blocks("b", blocks="update", raises=True))
    with pytest.raises(NodeFailedError, match="'Mission/s/b' failed: OSError: timed out"):
        tree.tick()
    assert watch.worst_s == {"Mission/s/b": 1.0}


def test_only_news_is_logged(
    world: World, wall: ManualClock, caplog: pytest.LogCaptureFixture
) -> None:
    """A leaf that blocks in every tick is reported each time, but logged only if it gets worse."""
    leaf = Blocks("b", blocks="update")
    tree, watch = watched(world, wall, leaf)
    for for_s in (1.0, 1.0, 0.8, 3.0):
        leaf._literals["for_s"] = for_s
        tree.tick()
    assert [slow.took_s for slow in watch.take()] == [1.0, 1.0, pytest.approx(0.8), 3.0]
    assert len(caplog.records) == 2
    assert watch.worst_s == {"Mission/s/b": 3.0}


def test_a_flight_reports_it(wall: ManualClock) -> None:
    """The runner measures, passes the result to its listeners, and reports the worst time.

    A leaf that blocks in the last halt, after the last tick, is reported, too.
    """
    drone = ScriptedDrone()
    leaves = [Blocks("b", blocks="update", for_s=0.75), Blocks("t", blocks="terminate", for_s=2.0)]
    tree = MissionTree(Parallel("s", leaves), name="Mission")
    context = MissionContext(clock=drone.clock)
    tree.setup(context)
    records: list[TickRecord] = []

    class Stops:
        def on_tick(self, record: TickRecord) -> None:
            records.append(record)
            if len(records) == 2:
                raise KeyboardInterrupt

    runner = MissionRunner(drone, tree, context, Judge(), listeners=(Stops(),), timer=wall.now)
    with pytest.raises(KeyboardInterrupt):
        runner.run()
    slow = SlowLeaf(path="Mission/s/b", took_s=0.75, budget_s=0.5)
    assert [record.slow for record in records] == [(slow,), (slow,)]
    assert records[0].compute_s == 0.75
    assert runner.budgets.worst_s == {"Mission/s/b": 0.75, "Mission/s/t": 2.0}
