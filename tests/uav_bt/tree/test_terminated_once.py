"""`terminate` is called exactly once per activation; exceptions leave no node running."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.worlds.trees import World, document
from uav_bt.errors import NodeFailedError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree

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
