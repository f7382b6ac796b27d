"""Leaves that block: measured on the wall clock, reported by name.

A leaf answers at once and goes on in the next tick. One that does not holds up the whole mission,
the arbiter's overrides included, and nothing else would say which leaf it was.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.nodes import BUILTIN_NODES

__all__ = ["BudgetWatch", "SlowLeaf"]

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SlowLeaf:
    """A leaf that took longer than it may."""

    path: str
    took_s: float  # wall time of one tick, or of one halt
    budget_s: float  # the `budget_s` of its class


class BudgetWatch:
    """Measures every leaf of a tree, from now on: `initialise`, `update` and `terminate`.

    The leaves get wrappers around their own methods, each leaf by itself, so that a tree which
    nobody watches pays nothing. The format's own leaves never block and are left alone.

    Args:
        tree: the tree.
        timer: the wall clock, seconds.
    """

    def __init__(
        self, tree: MissionTree, *, timer: Callable[[], float] = time.perf_counter
    ) -> None:
        self._timer = timer
        self._new: list[SlowLeaf] = []
        self._worst_s: dict[str, float] = {}
        for leaf in tree.leaves():
            if type(leaf) not in BUILTIN_NODES:
                self._watch(leaf)

    @property
    def worst_s(self) -> dict[str, float]:
        """The longest time of each leaf that ever exceeded its budget, by path."""
        return dict(self._worst_s)

    def take(self) -> tuple[SlowLeaf, ...]:
        """Return who exceeded the budget since the last question."""
        taken = tuple(self._new)
        self._new.clear()
        return taken

    def _watch(self, leaf: Leaf) -> None:
        timer, budget_s, exceeded = self._timer, leaf.budget_s, self._exceeded
        tick, halt = leaf._tick, leaf._halt  # noqa: SLF001  # wrapped, with no call in between

        def timed_tick() -> object:
            began_s = timer()
            try:
                return tick()
            finally:
                took_s = timer() - began_s
                if took_s > budget_s:
                    exceeded(leaf, took_s)

        def timed_halt() -> None:
            began_s = timer()
            try:
                halt()
            finally:
                took_s = timer() - began_s
                if took_s > budget_s:
                    exceeded(leaf, took_s)

        setattr(leaf, "_tick", timed_tick)  # noqa: B010  # of the instance, not of the class
        setattr(leaf, "_halt", timed_halt)  # noqa: B010

    def _exceeded(self, leaf: Leaf, took_s: float) -> None:
        self._new.append(SlowLeaf(path=leaf.path, took_s=took_s, budget_s=leaf.budget_s))
        if took_s <= self._worst_s.get(leaf.path, 0.0):
            return  # said before, and worse
        self._worst_s[leaf.path] = took_s
        _LOG.warning(
            "leaf '%s' blocked for %.2f s, its budget is %.2f s: "
            "it must answer at once and go on in the next tick",
            leaf.path,
            took_s,
            leaf.budget_s,
        )
