"""Watch for running branches that fail, and for the node at which a tree ends.

The cause of a failure is the deepest node that answered FAILURE in the same tick: a leaf, or a
decorator such as Timeout.
"""

from __future__ import annotations

from dataclasses import dataclass

from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.observer import NodeEvent, observe


@dataclass(frozen=True, kw_only=True)
class BranchEnds:
    """The ends of branches in one tick.

    Attributes:
        failed: Causes of the failures of branches that ran before, each once.
        ended: Node at which the whole tree ended. None: it goes on.
        succeeded: Whether it ended with SUCCESS.
    """

    failed: tuple[Node, ...] = ()
    ended: Node | None = None
    succeeded: bool = False


class BranchWatch:
    """Follows the answers of all nodes of a tree.

    Args:
        tree: Tree to follow.
    """

    def __init__(self, tree: MissionTree) -> None:
        self._running: set[Node] = set()
        self._failed: list[Node] = []  # in this tick, the deepest first
        self._lasted: set[Node] = set()  # among these, those that ran before
        self._succeeded: set[Node] = set()
        self.follow(tree)

    def follow(self, tree: MissionTree) -> None:
        """Follow another tree from now on."""
        self._root = tree.root
        observe(list(tree.nodes()), self._note)

    def take(self) -> BranchEnds:
        """Return the ends since the last call; call it after each tick."""
        failed, succeeded, lasted = set(self._failed), self._succeeded, self._lasted
        causes = dict.fromkeys(_cause(node, failed) for node in self._failed if node in lasted)
        self._failed, self._succeeded, self._lasted = [], set(), set()
        for answered in (failed, succeeded):
            if self._root in answered:
                ended = _cause(self._root, answered)
                others = tuple(cause for cause in causes if cause is not ended)
                return BranchEnds(failed=others, ended=ended, succeeded=answered is succeeded)
        return BranchEnds(failed=tuple(causes))

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is NodeEvent.CONTINUES:
            self._running.add(node)
        elif event is NodeEvent.FAILED:
            self._failed.append(node)
            if node in self._running:
                self._running.remove(node)
                self._lasted.add(node)
        elif event is NodeEvent.SUCCEEDED:
            self._succeeded.add(node)
            self._running.discard(node)
        elif event in (NodeEvent.HALTED, NodeEvent.SKIPPED):
            self._running.discard(node)


def _cause(node: Node, answered: set[Node]) -> Node:
    """Return the deepest node below that gave the same answer in this tick; the last of several."""
    below = [child for child in node.children if child in answered]
    return _cause(below[-1], answered) if below else node
