"""Nodes that choose one of their branches."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from uav_bt.errors import MissionError
from uav_bt.tree.flow import After, Follow, Known, joined
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import REAL, Port
from uav_bt.tree.script.values import compare_equal
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status


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
