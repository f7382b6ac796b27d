"""Nodes that choose one of their branches, or tick several at once."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from uav_bt.errors import MissionError
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import REAL, Port
from uav_bt.tree.script.values import compare_equal
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import After, Follow, Known, both, joined


class _Choice(ControlNode):
    """Ticks its second or third child, as the first answers."""

    min_children = 2
    max_children = 3
    asks_first = True

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow each branch after the answer that chooses it."""
        asked = follow(self.children[0], known)
        ways = (asked.success, asked.failure)
        chosen = [
            follow(child, known if way is None else way)
            for child, way in zip(self.children[1:], ways, strict=False)
        ]
        return joined(After(None, asked.failure if len(chosen) == 1 else None), *chosen)

    def _ask(self) -> Status:
        answer = self.children[0].execute_tick()
        if answer is SKIPPED:
            raise MissionError("the condition must not be skipped")
        return answer


class IfThenElse(_Choice):
    """Ticks its first child once, then the second on success or the third on failure to its end."""

    _chosen = 0  # index of the branch, 0 while the condition is asked

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        self.set_status(RUNNING)
        if self._chosen == 0:
            answer = self._ask()
            if answer is RUNNING:
                return RUNNING
            if answer is FAILURE and len(children) == 2:
                return FAILURE
            self._chosen = 1 if answer is SUCCESS else 2
        status = children[self._chosen].execute_tick()
        if status is not RUNNING:
            self._restart()
        return status

    def _restart(self) -> None:
        self._chosen = 0
        super()._restart()


class WhileDoElse(_Choice):
    """Ticks its first child in every tick, and the second on success or the third on failure."""

    ticks_again = True

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        self.set_status(RUNNING)
        answer = self._ask()
        if answer is RUNNING:
            return RUNNING
        chosen, other = (1, 2) if answer is SUCCESS else (2, 1)
        status = FAILURE
        if chosen < len(children):
            if other < len(children):
                children[other].reset()
            status = children[chosen].execute_tick()
        if status is not RUNNING:
            self._restart()
        return status


def _same(variable: object, case: str, members: Mapping[str, int]) -> bool:
    """Compare as texts, then as numbers, as the engine does; an enumeration's member is one."""
    text = str(variable)
    if text == case:
        return True
    text, case = (str(members.get(each, each)) for each in (text, case))
    if not (re.fullmatch(REAL, text) and re.fullmatch(REAL, case)):
        return False
    return compare_equal(float(text), float(case))


class _Switch(ControlNode):
    """Ticks the child whose case is the variable's value, or the last child."""

    VARIABLE: ClassVar = Port(
        "variable", object, doc="value that is compared with the cases", takes=(int, float, str)
    )
    cases: ClassVar[tuple[Port[str], ...]] = ()

    _running: int | None = None

    def __init_subclass__(cls, *, cases: int, **kwargs: Any) -> None:
        numbers = range(1, cases + 1)
        cls.cases = tuple(Port(f"case_{n}", str, doc=f"value of child {n}") for n in numbers)
        cls.ports = (cls.VARIABLE, *cls.cases)
        cls.min_children = cls.max_children = cases + 1
        super().__init_subclass__(**kwargs)

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow each child from the same start."""
        return joined(*(follow(child, known) for child in self.children))

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        chosen = self._choose()
        if self._running is not None and self._running != chosen:
            children[self._running].reset()
        status = children[chosen].execute_tick()
        if status is RUNNING:
            self._running = chosen
            return RUNNING
        self._running = None
        if status is not SKIPPED:
            self._restart()
        return status

    def _choose(self) -> int:
        value = self.held(self.VARIABLE)
        members = self.variables.enum_members
        if value is not None:
            for index, case in enumerate(self.cases):
                wanted = self.held(case)
                if wanted is not None and _same(value, wanted, members):
                    return index
        return len(self.cases)

    def _restart(self) -> None:
        self._running = None
        super()._restart()


class Switch2(_Switch, cases=2):
    """Ticks the child whose case is the variable's value, or the last of its three."""


class Switch3(_Switch, cases=3):
    """Ticks the child whose case is the variable's value, or the last of its four."""


class Switch4(_Switch, cases=4):
    """Ticks the child whose case is the variable's value, or the last of its five."""


class Switch5(_Switch, cases=5):
    """Ticks the child whose case is the variable's value, or the last of its six."""


class Switch6(_Switch, cases=6):
    """Ticks the child whose case is the variable's value, or the last of its seven."""


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
