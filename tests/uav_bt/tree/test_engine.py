"""The engine: recorded traces of BehaviorTree.CPP, activations, and watchers of nodes."""

from __future__ import annotations

import copy
import logging
from typing import Any, ClassVar

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.conformance import mismatch, read_traces
from tests.worlds.tables import cases
from tests.worlds.trees import World, document
from uav_bt import testing
from uav_bt.board import ELAPSED
from uav_bt.clock import ManualClock
from uav_bt.errors import NodeFailedError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.nodes import AlwaysSuccess, Sequence
from uav_bt.tree.watches import BranchEnds, BranchWatch, BudgetWatch, SlowLeaf

TRACES = list(read_traces())


@pytest.mark.parametrize("trace", TRACES, ids=[trace["id"] for trace in TRACES])
def test_trace_agrees(trace: dict[str, Any]) -> None:
    """Root status, order of leaf events and variables equal the engine's in every tick."""
    assert mismatch(trace) is None


@pytest.mark.parametrize("part", ["root", "events", "blackboard"])
def test_a_false_trace_is_noticed(part: str) -> None:
    trace = copy.deepcopy(TRACES[0])
    wrong: dict[str, Any] = {"root": "SKIPPED", "events": [["halt", "x"]], "blackboard": {"a": -7}}
    trace["ticks"][3][part] = wrong[part]
    reason = mismatch(trace)
    assert reason is not None
    assert reason.startswith("tick 3")


# --- activations: one `terminate` for each, and exceptions leave no node running ------------------

ANSWERS = {
    "S": Status.SUCCESS,
    "F": Status.FAILURE,
    "R": Status.RUNNING,
    "K": Status.SKIPPED,
    "t": Status.SUCCESS,
    "?": None,
}


class Told(Leaf):
    """Answers a letter per tick, counts its activations, and raises according to its script.

    `i` raises in initialise, `u` in update; `t` succeeds, and raises in terminate; `?` returns an
    invalid answer.
    """

    ports = (Port("script", str, doc="a letter a tick, over and over"),)

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self.begun = 0
        self.ended = 0
        self._ticks = 0
        self._now = ""

    def initialise(self) -> None:
        assert self.begun == self.ended, f"{self.path} began twice"
        self.begun += 1
        script = self.port_value("script")
        if script[self._ticks % len(script)] == "i":
            self._ticks += 1
            raise ZeroDivisionError("in initialise")

    def update(self) -> Status:
        script = self.port_value("script")
        self._now = script[self._ticks % len(script)]
        self._ticks += 1
        if self._now in "ui":
            raise ZeroDivisionError("in update")
        return ANSWERS[self._now]  # type: ignore[return-value]

    def terminate(self, new_status: Status) -> None:
        del new_status
        assert self.begun == self.ended + 1, f"{self.path} was told twice"
        self.ended += 1
        if self._now == "t":
            raise ZeroDivisionError("in terminate")


REGISTRY = NodeRegistry([Told])


def ready(body: str) -> MissionTree:
    world = World()
    tree = parse_tree(document(body), REGISTRY)
    tree.setup(world.context)
    tree.variables["a"] = 1
    return tree


SCRIPTS = st.text("SFRRKiut?", min_size=1, max_size=6)
MILD = st.text("SFRRK", min_size=1, max_size=6)
SOME = ("_skipIf='a == 2'", "_while='a != 3'", "_failureIf='a == 1'", "_onHalted='a=2'")
CONDITIONS = st.sampled_from(["", "", "", *(f" {condition}" for condition in SOME)])


def _leaves(scripts: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.builds(lambda s, c: f'<Told script="{s}"{c}/>', scripts, CONDITIONS)


def _is_loaded(tag: str, children: list[str]) -> bool:
    """Return whether the loader takes a node: a ReactiveSequence has at most one AsyncSequence."""
    running = [child for child in children if child.startswith("<AsyncSequence")]
    return tag != "ReactiveSequence" or len(running) <= 1


def _control(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    def of(tags: list[str], least: int, most: int) -> st.SearchStrategy[str]:
        nodes = st.tuples(
            st.sampled_from(tags), st.lists(inner, min_size=least, max_size=most), CONDITIONS
        )
        return nodes.filter(lambda node: _is_loaded(*node[:2])).map(
            lambda node: f"<{node[0]}{node[2]}>{''.join(node[1])}</{node[0].split()[0]}>"
        )

    orders = "Sequence Fallback ReactiveSequence ReactiveFallback SequenceWithMemory"
    at_once = "AsyncSequence AsyncFallback Parallel ParallelAll"
    many = of(f"{orders} {at_once}".split(), 1, 3)
    plain = "Inverter ForceSuccess ForceFailure KeepRunningUntilFailure RunOnce"
    counting = ['Repeat num_cycles="2"', 'RetryUntilSuccessful num_attempts="2"']
    waiting = ['SkipUnlessUpdated entry="{a}"', 'WaitValueUpdate entry="{a}"', 'Timeout msec="100"']
    one = of([*plain.split(), *counting, *waiting], 1, 1)
    branches = of(["IfThenElse", "WhileDoElse", "TryCatch", 'TryCatch catch_on_halt="true"'], 3, 3)
    switch = of(['Switch2 variable="{a}" case_1="1" case_2="2"'], 3, 3)
    return many | one | branches | switch


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(
    body=st.recursive(_leaves(SCRIPTS) | _leaves(MILD), _control, max_leaves=8),
    steps=st.lists(st.sampled_from(["tick", "tick", "tick", "halt", "1", "2", "3"]), max_size=12),
)
def test_any_tree_any_script(body: str, steps: list[str]) -> None:
    tree = ready(body)
    for step in [*steps, "halt"]:
        if step in "123":
            tree.variables["a"] = int(step)
            continue
        failure = None
        try:
            getattr(tree, step)()
        except NodeFailedError as error:
            failure = error
        # An assertion inside a leaf appears as the failure of its node.
        assert failure is None or not isinstance(failure.__cause__, AssertionError), failure
        if failure is not None or step == "halt":
            leaves = [leaf for leaf in tree.leaves() if isinstance(leaf, Told)]
            assert [leaf.path for leaf in leaves if leaf.begun != leaf.ended] == []
            assert {node.node_status for node in tree.nodes()} == {Status.IDLE}


# --- watchers: leaves that block ------------------------------------------------------------------


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


# --- watchers: branches that fail -----------------------------------------------------------------

ROOT = '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree></root>'
BRANCHES = cases("branches")


@pytest.mark.parametrize(("text", "mocks", "ticks", "causes", "ended"), BRANCHES)
def test_causes_of_failures(
    text: str, mocks: dict[str, str], ticks: int, causes: list[list[str]], ended: str | None
) -> None:
    bench = testing.parse_tree(ROOT.format(text), mocks=mocks)
    watch, found = BranchWatch(bench.tree), []
    ends = BranchEnds()
    for _ in range(ticks):
        bench.tick()
        ends = watch.take()
        found.append([node.path for node in (*ends.failed, *ends.expected)])
    assert found == causes
    assert (None if ends.ended is None else ends.ended.path) == ended


TURN, HOVER, FACE = '<Turn degrees="9"/>', "<HoverFor/>", '<Face at="9"/>'
PLAN = f"<Sequence>{TURN}{HOVER}</Sequence>"
RETRY = '<RetryUntilSuccessful num_attempts="2">{}</RetryUntilSuccessful>'
LOOP = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
GUARD = f"<ReactiveSequence><Hovering/>{TURN}</ReactiveSequence>"


@pytest.mark.parametrize(
    ("tree", "mocks", "changes"),
    [
        (f"<Fallback>{PLAN}{FACE}</Fallback>", {"Turn": "RF"}, True),
        (f"<ForceSuccess>{PLAN}</ForceSuccess>", {"Turn": "RF"}, True),  # a step is left out
        (f"<Fallback>{GUARD}{FACE}</Fallback>", {"Hovering": "SF", "Turn": "R"}, True),
        (f"<TryCatch>{TURN}{FACE}</TryCatch>", {"Turn": "RF"}, True),
        (f"<Fallback>{TURN}{FACE}</Fallback>", {"Turn": "RF"}, False),
        (f"<ForceSuccess>{GUARD}</ForceSuccess>", {"Hovering": "SF", "Turn": "R"}, False),
        (f"<Inverter>{TURN}</Inverter>", {"Turn": "RF"}, False),
        (f'<ForceSuccess><Timeout msec="100">{TURN}</Timeout></ForceSuccess>', {}, False),
        (RETRY.format(PLAN), {"Turn": "RFR"}, False),
        (f"<ForceSuccess>{LOOP.format(PLAN)}</ForceSuccess>", {"Turn": "RF"}, False),
    ],
)
def test_a_failure_that_the_tree_expects_does_not_change_the_course(
    tree: str, mocks: dict[str, str], *, changes: bool
) -> None:
    text = f"<Sequence>{tree}{FACE}</Sequence>"
    answers = {"HoverFor": "S", "Turn": "R", "Face": "R"} | mocks
    used = {name: answer for name, answer in answers.items() if f"<{name}" in text}
    bench = testing.parse_tree(ROOT.format(text), mocks=used)
    watch = BranchWatch(bench.tree)
    bench.tick()
    assert watch.take() == BranchEnds()
    bench.tick()
    ends = watch.take()
    assert (len(ends.failed), len(ends.expected)) == (int(changes), int(not changes))


def test_a_leaf_that_is_skipped_while_it_runs_did_not_fail() -> None:
    tree = '<Fallback name="f"><HoverFor _while="@elapsed_s &lt; 1"/><Turn degrees="9"/></Fallback>'
    bench = testing.parse_tree(ROOT.format(tree), mocks={"HoverFor": "R", "Turn": "R"})
    watch = BranchWatch(bench.tree)
    for elapsed_s in (0.5, 1.5):
        bench.board[ELAPSED] = elapsed_s
        bench.tick()
        assert watch.take() == BranchEnds()
    bench.log.assert_halted("HoverFor", times=1)
