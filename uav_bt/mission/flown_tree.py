"""The tree that flies, and its replacement by another one between two ticks."""

from __future__ import annotations

import time
from collections.abc import Callable

from uav_bt.errors import NodeFailedError
from uav_bt.tree import MissionTree, Status
from uav_bt.tree.branch_watch import BranchWatch
from uav_bt.tree.budget import BudgetWatch

NextTree = Callable[[], MissionTree | None]
"""Called between two ticks: returns a new tree, set up, or None to keep the present one."""


class FlownTree:
    """The tree that flies, which may be replaced in flight.

    Args:
        tree: the first one, set up.
        next_tree: returns a replacement; None keeps the first tree for the whole flight.
        timer: wall clock for the computing time of leaves, seconds.
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
        self.branches = BranchWatch(tree)
        self._next_tree = next_tree
        self._is_halted = True  # not ticked since the last halt

    def tick(self) -> Status:
        """Tick the tree; one in which a node raises has halted itself."""
        self._is_halted = False
        try:
            return self.tree.tick()
        except NodeFailedError:
            self._is_halted = True
            raise

    def halt(self) -> None:
        """Halt the tree once: each further halt would run its `_onHalted` scripts again."""
        if not self._is_halted:
            self._is_halted = True
            self.tree.halt()

    def renew(self) -> None:
        """Switch to the next tree, if there is one; call it between two ticks.

        The old tree is halted first. The new one begins at its root, on the same board, and its
        leaves may inherit the state of the old ones. Then the old tree is shut down.

        Raises:
            NodeFailedError: a leaf raised when it was halted, inherited or was shut down.
        """
        tree = None if self._next_tree is None else self._next_tree()
        if tree is None:
            return
        self.halt()
        former, self.tree = self.tree, tree
        self.budgets.follow(tree)
        self.branches.follow(tree)
        tree.inherit(former)
        former.shutdown()
