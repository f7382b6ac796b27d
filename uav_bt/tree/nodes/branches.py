"""Nodes that choose one of their branches."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar, Final

from uav_bt.errors import MissionError
from uav_bt.tree.flow import After, Follow, Known, in_order, joined
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import Port
from uav_bt.tree.script.values import compare_equal
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, Status

_REAL: Final = re.compile(r"-?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


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


class IfThenElse(_Choice):
    """Ticks its first child once, then the second on success or the third on failure to its end."""

    _chosen = 0  # index of the branch, 0 while the condition is asked

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        self.set_status(RUNNING)
        if self._chosen == 0:
            answer = children[0].execute_tick()
            if answer is RUNNING:
                return RUNNING
            if answer is SKIPPED:
                raise MissionError("the condition must not be skipped")
            if answer is FAILURE and len(children) == 2:
                return FAILURE
            self._chosen = 1 if answer is SUCCESS else 2
        status = children[self._chosen].execute_tick()
        if status is not RUNNING:
            self._reset_children()
            self._chosen = 0
        return status

    def _halt(self) -> None:
        self._chosen = 0
        super()._halt()


class WhileDoElse(_Choice):
    """Ticks its first child in every tick, and the second on success or the third on failure."""

    ticks_again = True

    def update(self) -> Status:
        """Tick the children."""
        children = self.children
        self.set_status(RUNNING)
        answer = children[0].execute_tick()
        if answer is RUNNING:
            return RUNNING
        if answer is SKIPPED:
            raise MissionError("the condition must not be skipped")
        status = FAILURE
        if answer is SUCCESS:
            if len(children) == 3:
                children[2].reset()
            status = children[1].execute_tick()
        elif len(children) == 3:
            children[1].reset()
            status = children[2].execute_tick()
        if status is not RUNNING:
            self._reset_children()
        return status


def _same(variable: object, case: str, members: Mapping[str, int]) -> bool:
    """Compare as texts, then as numbers, as the engine does; an enumeration's member is one."""
    text = str(variable)
    if text == case:
        return True
    text, case = (str(members.get(each, each)) for each in (text, case))
    if not (_REAL.fullmatch(text) and _REAL.fullmatch(case)):
        return False
    return compare_equal(float(text), float(case))


_SWITCH_DOC: Final = "Ticks the child whose case is the variable's value, or the last of its {}."


class _Switch(ControlNode):
    """Ticks the child whose case is the variable's value, or the last child."""

    VARIABLE: ClassVar = Port(
        "variable", object, doc="value that is compared with the cases", takes=(int, float, str)
    )
    cases: ClassVar[tuple[Port[str], ...]] = ()

    _running: int | None = None

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
            self._reset_children()
        return status

    def _choose(self) -> int:
        reading = self.port_reading(self.VARIABLE)
        members = self.variables.enum_members
        if reading.value is not None:
            for index, case in enumerate(self.cases):
                wanted = self.port_reading(case).value
                if wanted is not None and _same(reading.value, wanted, members):
                    return index
        return len(self.cases)

    def _halt(self) -> None:
        self._running = None
        super()._halt()


def _switch(cases: int, children: str) -> type[_Switch]:
    """Return the class for a number of cases; `children` is one more, in words."""
    ports = tuple(Port(f"case_{n}", str, doc=f"value of child {n}") for n in range(1, cases + 1))
    body = {
        "__doc__": _SWITCH_DOC.format(children),
        "__module__": __name__,
        "cases": ports,
        "ports": (_Switch.VARIABLE, *ports),
        "min_children": cases + 1,
        "max_children": cases + 1,
    }
    return type(f"Switch{cases}", (_Switch,), body)


Switch2 = _switch(2, "three")
Switch3 = _switch(3, "four")
Switch4 = _switch(4, "five")
Switch5 = _switch(5, "six")
Switch6 = _switch(6, "seven")


class TryCatch(ControlNode):
    """Ticks all children but the last as a Sequence; when one fails, the last cleans up."""

    CATCH_ON_HALT = Port(
        "catch_on_halt", bool, default=False, doc="clean up also when halted (one tick of it)"
    )
    ports = (CATCH_ON_HALT,)
    min_children = 2

    _index = 0
    _skipped = 0
    _catching = False

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow all but the last in order; the last may also run after a halt."""
        *tried, last = self.children
        after = in_order(tried, follow, known, falls_back=False)
        follow(last, known)
        return after

    def update(self) -> Status:
        """Tick the children."""
        if self.node_status is IDLE:
            self._skipped = 0
            self._catching = False
        self.set_status(RUNNING)
        return self._catch() if self._catching else self._try()

    def _try(self) -> Status:
        children = self.children
        count = len(children) - 1
        while self._index < count:
            status = children[self._index].execute_tick()
            if status is RUNNING:
                return RUNNING
            if status is FAILURE:
                self._reset_children()
                self._index = 0
                self._catching = True
                return self._catch()
            self._index += 1
            if status is SKIPPED:
                self._skipped += 1
        all_skipped = self._skipped == count
        self._reset_children()
        self._index = 0
        self._skipped = 0
        return SKIPPED if all_skipped else SUCCESS

    def _catch(self) -> Status:
        if self.children[-1].execute_tick() is RUNNING:
            return RUNNING
        self._reset_children()
        self._index = 0
        self._catching = False
        return FAILURE

    def _halt(self) -> None:
        if self.node_status is not IDLE and not self._catching and self.port(self.CATCH_ON_HALT):
            *tried, last = self.children
            for child in tried:
                child.reset()
            if last.execute_tick() is RUNNING:
                last.reset()
        self._index = 0
        self._skipped = 0
        self._catching = False
        super()._halt()
