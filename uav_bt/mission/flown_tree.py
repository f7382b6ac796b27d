"""The tree that flies, and its replacement by another one between two ticks."""

from __future__ import annotations

import time
from collections.abc import Callable

from uav_bt.tree import MissionTree
from uav_bt.tree.budget import BudgetWatch

NextTree = Callable[[], MissionTree | None]
"""Asked between two ticks: a tree that is set up and flies from now on, or None for no other."""


class FlownTree:
    """The tree that flies: one for the whole flight, or one after another.

    Args:
        tree: the first one, set up.
        next_tree: asked for another; None where the first one flies the whole flight.
        timer: the wall clock that leaves are measured with, seconds.
    """

    def __init__(
        self,
        tree: MissionTree,
        next_tree: NextTree | None = None,
        *,
        timer: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.tree = tree
        self.budgets = BudgetWatch(tree, timer=timer)
        self._next_tree = next_tree

    def renew(self) -> None:
        """Let the next tree fly, where there is one; to be called between two ticks.

        The old one is halted first. The new one begins at its root, on the same board, and its
        leaves may go on from what those of the old one know. Then the old one is shut down.

        Raises:
            NodeFailedError: a leaf raised when it was halted, took over or was shut down.
        """
        tree = None if self._next_tree is None else self._next_tree()
        if tree is None:
            return
        self.tree.halt()
        former, self.tree = self.tree, tree
        self.budgets.follow(tree)
        tree.inherit(former)
        former.shutdown()
