"""Nodes that tick all their children at every tick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from uav_bt.errors import MissionError
from uav_bt.tree.flow import After, Follow, Known, both
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status


def _threshold(count: int, children: int) -> int:
    """Return a threshold; negative counts from the end, so that -1 means all."""
    return max(children + count + 1, 0) if count < 0 else count


class _Counting(ControlNode):
    """A node whose ports count its children."""

    ticks_together = True

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow all children from the same start; before a smaller count, some may still run."""
        ended, skips = known, True
        for child in self.children:
            after = follow(child, known)
            ended |= both(both(after.success, after.failure), after.skipped) or known
            skips = skips and after.skipped is not None
        every = self.literals.get("success_count", -1) == -1
        return After(ended if every else known, known, known if skips else None)

    @classmethod
    def ports_over(cls, children: int) -> tuple[Port[Any], ...]:
        """Return the ports; none counts more children than there are."""

        def check(count: int) -> None:
            if count > children:
                raise ValueError(f"expected at most its {children} children, got {count}")

        return tuple(replace(port, check=check) for port in cls.ports)


class Parallel(_Counting):
    """Ticks all its children until enough have succeeded or too many have failed."""

    SUCCESS_COUNT = Port(
        "success_count", int, default=-1, doc="how many must succeed; -1: all, -2: all but one"
    )
    FAILURE_COUNT = Port(
        "failure_count", int, default=1, doc="how many failures end it; -1: all, -2: all but one"
    )
    ports = (SUCCESS_COUNT, FAILURE_COUNT)

    _successes = 0
    _failures = 0

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        count = len(children)
        success_count = self.port(self.SUCCESS_COUNT)
        needed = _threshold(success_count, count)
        fatal = _threshold(self.port(self.FAILURE_COUNT), count)
        if max(needed, fatal) > count:
            raise MissionError(
                f"success_count and failure_count must not exceed the {count} children, "
                f"got {needed} and {fatal}"
            )
        self.set_status(RUNNING)
        skipped = 0
        for child in children:
            # A finished child keeps its status until all are reset and is not ticked again.
            if child.node_status is not SUCCESS and child.node_status is not FAILURE:
                status = child.execute_tick()
                if status is SKIPPED:
                    skipped += 1
                elif status is SUCCESS:
                    self._successes += 1
                elif status is FAILURE:
                    self._failures += 1
            spared = skipped if success_count < 0 else 0
            if self._successes + spared >= needed:
                self._restart()
                return SUCCESS
            if count - self._failures < needed or self._failures == fatal:
                self._restart()
                return FAILURE
        return SKIPPED if skipped == count else RUNNING

    def _restart(self) -> None:
        self._successes = self._failures = 0
        super()._restart()


class ParallelAll(_Counting):
    """Ticks all its children until all have finished; fails when too many of them failed."""

    MAX_FAILURES = Port(
        "max_failures", int, default=1, doc="failures that make it fail; -1: all, -2: all but one"
    )
    ports = (MAX_FAILURES,)

    _failures = 0

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        count = len(children)
        fatal = _threshold(self.port(self.MAX_FAILURES), count)
        if fatal > count:
            raise MissionError(f"max_failures must not exceed the {count} children, got {fatal}")
        self.set_status(RUNNING)
        skipped = 0
        finished = 0
        for child in children:
            status = child.node_status
            if status is not SUCCESS and status is not FAILURE:
                status = child.execute_tick()
                self._failures += status is FAILURE
            skipped += status is SKIPPED
            finished += status is SUCCESS or status is FAILURE
        if skipped == count:
            return SKIPPED
        if skipped + finished < count:
            return RUNNING
        failed = self._failures >= fatal
        self._restart()
        return FAILURE if failed else SUCCESS

    def _restart(self) -> None:
        self._failures = 0
        super()._restart()
