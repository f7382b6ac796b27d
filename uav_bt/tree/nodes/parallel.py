"""Nodes that tick all their children at every tick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from uav_bt.errors import MissionError
from uav_bt.tree.flow import After, Follow, Known, both
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status


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

    _successes = 0
    _failures = 0

    def _count(self, port: Port[int]) -> int:
        """Return a port's count; negative counts from the end, so that -1 means all."""
        given, children = self.port(port), len(self.children)
        count = max(children + given + 1, 0) if given < 0 else given
        if count > children:
            raise MissionError(f"{port.name} must not exceed the {children} children, got {count}")
        return count

    def _restart(self) -> None:
        self._successes = self._failures = 0
        super()._restart()


class Parallel(_Counting):
    """Ticks all its children until enough have succeeded or too many have failed."""

    SUCCESS_COUNT = Port(
        "success_count", int, default=-1, doc="how many must succeed; -1: all, -2: all but one"
    )
    FAILURE_COUNT = Port(
        "failure_count", int, default=1, doc="how many failures end it; -1: all, -2: all but one"
    )
    ports = (SUCCESS_COUNT, FAILURE_COUNT)

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        count = len(children)
        needed, fatal = self._count(self.SUCCESS_COUNT), self._count(self.FAILURE_COUNT)
        spares = self.port(self.SUCCESS_COUNT) < 0  # a skipped child counts as one that succeeded
        self.set_status(RUNNING)
        skipped = 0
        for child in children:
            # A finished child keeps its status until all are reset and is not ticked again.
            if child.node_status is not SUCCESS and child.node_status is not FAILURE:
                status = child.execute_tick()
                skipped += status is SKIPPED
                self._successes += status is SUCCESS
                self._failures += status is FAILURE
            if self._successes + (skipped if spares else 0) >= needed:
                self._restart()
                return SUCCESS
            if count - self._failures < needed or self._failures == fatal:
                self._restart()
                return FAILURE
        return SKIPPED if skipped == count else RUNNING


class ParallelAll(_Counting):
    """Ticks all its children until all have finished; fails when too many of them failed."""

    MAX_FAILURES = Port(
        "max_failures", int, default=1, doc="failures that make it fail; -1: all, -2: all but one"
    )
    ports = (MAX_FAILURES,)

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        count = len(children)
        fatal = self._count(self.MAX_FAILURES)
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
