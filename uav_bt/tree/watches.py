"""Watches of a tree in flight: leaves that block, running branches that fail, and its end.

A leaf must return at once and continue in the next tick. A leaf that blocks delays the whole
mission, including the arbiter's overrides, and nothing else would report which leaf it was.

The cause of a failure is the deepest node that answered FAILURE in the same tick: a leaf, or a
decorator such as Timeout.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Final

from uav_bt.tree import nodes
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.observer import NodeEvent, observe

_log: Final = logging.getLogger(__name__)
_BLOCKED: Final = (
    "leaf '%s' blocked for %.2f s, its budget is %.2f s: "
    "it must answer at once and go on in the next tick"
)
_BEGINNINGS: Final = (NodeEvent.STARTED, NodeEvent.RAN, NodeEvent.HALTING)


@dataclass(frozen=True, kw_only=True)
class SlowLeaf:
    """A leaf that exceeded its time budget."""

    path: str
    took_s: float  # wall time of one tick, or of one halt
    budget_s: float  # the `budget_s` of its class


class BudgetWatch:
    """Measures `initialise`, `update` and `terminate` of every leaf that is not of the format.

    `timer` is the wall clock, in seconds.
    """

    def __init__(
        self, tree: MissionTree, *, timer: Callable[[], float] = time.perf_counter
    ) -> None:
        self.worst_s: dict[str, float] = {}  # longest times beyond the budget, by path
        self._timer = timer
        self._began_s: float | None = None  # start time of the running leaf; at most one runs
        self._new: list[SlowLeaf] = []
        self.follow(tree)

    def follow(self, tree: MissionTree) -> None:
        """Measure the leaves of another tree as well."""
        builtin = nodes.BUILTIN_NODES
        observe([leaf for leaf in tree.leaves() if type(leaf) not in builtin], self._note)

    def take(self) -> tuple[SlowLeaf, ...]:
        """Return the leaves that exceeded their budgets since the last call."""
        taken, self._new = self._new, []
        return tuple(taken)

    def _note(self, leaf: Leaf, event: NodeEvent) -> None:
        if event in _BEGINNINGS:
            self._began_s = self._timer()
        elif event is not NodeEvent.STATUS and self._began_s is not None:
            took_s, self._began_s = self._timer() - self._began_s, None
            if took_s > leaf.budget_s:
                self._new.append(SlowLeaf(path=leaf.path, took_s=took_s, budget_s=leaf.budget_s))
                if took_s > self.worst_s.get(leaf.path, 0.0):  # else reported with a longer time
                    self.worst_s[leaf.path] = took_s
                    _log.warning(_BLOCKED, leaf.path, took_s, leaf.budget_s)


@dataclass(frozen=True, kw_only=True)
class BranchEnds:
    """The ends of branches in one tick."""

    # Causes of the failures of branches that ran before, each once: those that change the course of
    # the mission, and those after which the tree is written to go on.
    failed: tuple[Node, ...] = ()
    expected: tuple[Node, ...] = ()
    ended: Node | None = None  # at which the whole tree ended; None: it goes on
    succeeded: bool = False  # whether it ended with SUCCESS


class BranchWatch:
    """Follows the answers of all nodes of a tree."""

    def __init__(self, tree: MissionTree) -> None:
        self._running: set[Node] = set()
        self._failed: dict[Node, bool] = {}  # in this tick, and whether it ran
        self._succeeded: set[Node] = set()
        self._halted: set[Node] = set()
        self.follow(tree)

    def follow(self, tree: MissionTree) -> None:
        """Follow another tree from now on."""
        self._root = tree.root
        observe(list(tree.nodes()), self._note)

    def take(self) -> BranchEnds:
        """Return the ends since the last call; call it after each tick."""
        failed, self._failed = self._failed, {}
        succeeded, self._succeeded = self._succeeded, set()
        halted, self._halted = self._halted, set()
        causes = dict.fromkeys(_cause(node, failed) for node, lasted in failed.items() if lasted)
        ended = None
        if self._root in failed or self._root in succeeded:
            ended = _cause(self._root, failed if self._root in failed else succeeded)
            causes.pop(ended, None)
        turns = [cause for cause in causes if _changes_course(cause, failed, halted)]
        return BranchEnds(
            failed=tuple(turns),
            expected=tuple(cause for cause in causes if cause not in turns),
            ended=ended,
            succeeded=self._root in succeeded,
        )

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is NodeEvent.CONTINUES:
            self._running.add(node)
        elif event is NodeEvent.FAILED:
            self._failed[node] = node in self._running or self._failed.get(node, False)
            self._running.discard(node)
        elif event is NodeEvent.SUCCEEDED:
            self._succeeded.add(node)
            self._running.discard(node)
        elif event in (NodeEvent.HALTED, NodeEvent.SKIPPED):
            self._running.discard(node)
            if event is NodeEvent.HALTED:
                self._halted.add(node)


def _cause(node: Node, answered: Collection[Node]) -> Node:
    """Return the deepest node below that gave the same answer in this tick; the last of several."""
    below = [child for child in node.children if child in answered]
    return _cause(below[-1], answered) if below else node


def _changes_course(cause: Node, failed: Collection[Node], halted: Collection[Node]) -> bool:
    """Return whether a failure changes the course of the mission, or is expected by the tree.

    It changes the course where a Sequence ends by it, and where it ends a running child of a
    ReactiveSequence, in whose place a Fallback runs another one. A loop that begins again, or that
    runs until a failure, expects it.
    """
    node: Any = cause
    ends = interrupts = False
    while (parent := node.parent) is not None:
        if isinstance(parent, nodes.KeepRunningUntilFailure):
            ends = interrupts = False
        ends |= isinstance(parent, nodes.Sequence | nodes.TryCatch)
        if isinstance(parent, nodes.ReactiveSequence):
            interrupts |= any(child in halted for child in parent.children if child is not node)
        if parent not in failed:
            ends |= interrupts and isinstance(parent, nodes.Fallback | nodes.ReactiveFallback)
            return ends and not isinstance(parent, nodes.RetryUntilSuccessful)
        node = parent
    return True
