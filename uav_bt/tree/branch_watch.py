"""Watch for running branches that fail, and for the node at which a tree ends.

The cause of a failure is the deepest node that answered FAILURE in the same tick: a leaf, or a
decorator such as Timeout.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.observer import NodeEvent, observe


@dataclass(frozen=True, kw_only=True)
class BranchEnds:
    """The ends of branches in one tick."""

    failed: tuple[Node, ...] = ()  # causes of the failures of branches that ran before, each once
    ended: Node | None = None  # at which the whole tree ended; None: it goes on
    succeeded: bool = False  # whether it ended with SUCCESS


class BranchWatch:
    """Follows the answers of all nodes of a tree."""

    def __init__(self, tree: MissionTree) -> None:
        self._running: set[Node] = set()
        self._failed: dict[Node, bool] = {}  # in this tick, and whether it ran
        self._succeeded: set[Node] = set()
        self.follow(tree)

    def follow(self, tree: MissionTree) -> None:
        """Follow another tree from now on."""
        self._root = tree.root
        observe(list(tree.nodes()), self._note)

    def take(self) -> BranchEnds:
        """Return the ends since the last call; call it after each tick."""
        failed, self._failed = self._failed, {}
        succeeded, self._succeeded = self._succeeded, set()
        causes = dict.fromkeys(_cause(node, failed) for node, lasted in failed.items() if lasted)
        if self._root not in failed and self._root not in succeeded:
            return BranchEnds(failed=tuple(causes))
        ended = _cause(self._root, failed if self._root in failed else succeeded)
        others = tuple(cause for cause in causes if cause is not ended)
        return BranchEnds(failed=others, ended=ended, succeeded=self._root not in failed)

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


def _cause(node: Node, answered: Collection[Node]) -> Node:
    """Return the deepest node below that gave the same answer in this tick; the last of several."""
    below = [child for child in node.children if child in answered]
    return _cause(below[-1], answered) if below else node
