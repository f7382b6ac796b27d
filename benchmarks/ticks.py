"""Count ticks per second, ours beside py_trees' own composites on the same shapes.

    python benchmarks/ticks.py
    python benchmarks/ticks.py --nodes 50 1000 --rounds 15

Every tree is a sequence of sequences and fallbacks in turn, and every tick visits all its nodes.
The leaves do the same on both sides: nothing (bare), or read one number and compare it: through a
port that refers to a variable (`{key}`) or to the mission board (`{@key}`) here, through a
blackboard client there. Each engine has leaves of its own kind, for a leaf of ours under a
composite of py_trees would be ticked through two engines.

All contestants run in turn, a short while each, over many rounds, so that a busy machine slows all
of them; medians and quartiles over the rounds are printed, and ratios are taken within a round.
"""

from __future__ import annotations

import argparse
import math
import platform
import statistics
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version

import py_trees
from py_trees.common import Status as Theirs

from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.errors import UnknownNameError
from uav_bt.protocols import LeafPolicy
from uav_bt.tree import Leaf, MissionTree, Node, Port, Status
from uav_bt.tree.nodes import Fallback, Sequence

NUMBER = Key("number", float, "what the leaves read")


class Reader(Leaf):
    """Reads a number through its port and answers."""

    VALUE = Port("value", float, doc="what is read")
    LIMIT = Port("limit", float, default=0.0, doc="below it: fail")
    ports = (VALUE, LIMIT)

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._limit = self.port(self.LIMIT)

    def update(self) -> Status:
        """Read and compare."""
        return Status.SUCCESS if self.port(self.VALUE) >= self._limit else Status.FAILURE


class Bare(Leaf):
    """Returns a fixed status."""

    answer = Status.SUCCESS

    def update(self) -> Status:
        """Answer."""
        return self.answer


class TheirBare(py_trees.behaviour.Behaviour):
    """The same, of py_trees' kind."""

    answer = Theirs.SUCCESS

    def update(self) -> Theirs:
        """Answer."""
        return self.answer


class TheirReader(py_trees.behaviour.Behaviour):
    """Reads a number through a blackboard client and answers."""

    def __init__(self, name: str, limit: float) -> None:
        super().__init__(name)
        self._limit = limit
        self.blackboard = self.attach_blackboard_client(name=name)
        self.blackboard.register_key(key=NUMBER.name, access=py_trees.common.Access.READ)

    def update(self) -> Theirs:
        """Read and compare."""
        return Theirs.SUCCESS if self.blackboard.number >= self._limit else Theirs.FAILURE


def plan(nodes: int) -> list[int]:
    """Return how many leaves each branch of a tree of that many nodes has."""
    branches = max(1, round(math.sqrt(nodes)))
    leaves = nodes - 1 - branches
    return [leaves // branches + (index < leaves % branches) for index in range(branches)]


def answers(branches: list[int]) -> Iterator[list[bool]]:
    """Iterate over the branches; of each leaf, whether it succeeds.

    In a fallback all leaves but the last fail, so that all are visited.
    """
    for index, count in enumerate(branches):
        yield [index % 2 == 0 or leaf == count - 1 for leaf in range(count)]


def our_tree(nodes: int, reference: str | None) -> Callable[[], object]:
    """Return what ticks one of our trees once.

    Args:
        nodes: how many.
        reference: variable that the leaves read, such as `{number}`; None for bare ones.
    """
    branches: list[Node] = []
    for index, row in enumerate(answers(plan(nodes))):
        leaves: list[Node] = []
        for good in row:
            if reference is None:
                bare = Bare()
                bare.answer = Status.SUCCESS if good else Status.FAILURE
                leaves.append(bare)
            else:
                leaves.append(Reader(value=reference, limit=0.0 if good else math.pi))
        branches.append((Fallback if index % 2 else Sequence)(f"branch{index}", leaves))
    tree = MissionTree(Sequence("root", branches))
    clock = ManualClock()
    board = Blackboard(clock, (NUMBER,))
    board.write(NUMBER, 1.0)
    tree.variables[NUMBER.name] = 1.0
    tree.setup(MissionContext(board=board, clock=clock, proposals=Proposals(), policy=_no_policy))
    if len(list(tree.nodes())) != nodes:
        raise RuntimeError(f"expected {nodes} nodes, made {len(list(tree.nodes()))}")
    return tree.tick


def _their_tree(nodes: int, *, reads: bool) -> Callable[[], object]:
    """Return what ticks the same tree of py_trees once."""
    writer = py_trees.blackboard.Client(name="writer")
    writer.register_key(key=NUMBER.name, access=py_trees.common.Access.WRITE)
    writer.number = 1.0
    branches: list[py_trees.behaviour.Behaviour] = []
    for index, row in enumerate(answers(plan(nodes))):
        leaves: list[py_trees.behaviour.Behaviour] = []
        for good in row:
            if reads:
                leaves.append(TheirReader("leaf", 0.0 if good else math.pi))
            else:
                bare = TheirBare("leaf")
                bare.answer = Theirs.SUCCESS if good else Theirs.FAILURE
                leaves.append(bare)
        kind = py_trees.composites.Selector if index % 2 else py_trees.composites.Sequence
        branches.append(kind(f"branch{index}", memory=True, children=leaves))
    root = py_trees.composites.Sequence("root", memory=True, children=branches)
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup()
    root.tick_once()
    if root.status is not Theirs.SUCCESS:
        raise RuntimeError(f"py_trees did not visit all nodes: {root.status}")
    return root.tick_once


def _no_policy(name: str) -> LeafPolicy:
    raise UnknownNameError("policy", name, ())


def rate(tick: Callable[[], object], duration_s: float) -> float:
    """Return ticks per second, measured over about this time."""
    ticks = 0
    began = time.perf_counter()
    while (passed := time.perf_counter() - began) < duration_s:
        tick()
        ticks += 1
    return ticks / passed


def measure(nodes: int, rounds: int, slice_s: float) -> Iterator[str]:
    """Measure all contestants on trees of one size; give a table's rows."""
    rivals = {
        "py_trees, bare": _their_tree(nodes, reads=False),
        "uav_bt, bare": our_tree(nodes, None),
        "py_trees, Client reads": _their_tree(nodes, reads=True),
        "uav_bt, reads of {key}": our_tree(nodes, "{number}"),
        "uav_bt, reads of {@key}": our_tree(nodes, "{@number}"),
    }
    rates: dict[str, list[float]] = {name: [] for name in rivals}
    for tick in rivals.values():
        rate(tick, slice_s)  # warm up
    for _ in range(rounds):
        for name, tick in rivals.items():
            rates[name].append(rate(tick, slice_s))
    for name, values in rates.items():
        base = rates["py_trees, Client reads" if "reads" in name else "py_trees, bare"]
        ratios = [ours / theirs for ours, theirs in zip(values, base, strict=True)]
        low, median, high = statistics.quantiles(values, n=4)
        ratio = "" if values is base else f"{statistics.median(ratios):.1f}"
        yield f"| {nodes} | {name} | {median:,.0f} | {low:,.0f} - {high:,.0f} | {ratio} |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=[50, 1000])
    parser.add_argument("--rounds", type=int, default=15, help="how often each one's turn comes")
    parser.add_argument("--slice-s", type=float, default=0.2, help="how long a turn takes")
    arguments = parser.parse_args()
    print(
        f"{platform.machine()}, Python {platform.python_version()}, py_trees {version('py_trees')}"
    )
    print("| nodes | tree | ticks/s (median) | quartiles | times py_trees |")
    print("|---|---|---|---|---|")
    for nodes in arguments.nodes:
        for row in measure(nodes, arguments.rounds, arguments.slice_s):
            print(row)


if __name__ == "__main__":
    main()
