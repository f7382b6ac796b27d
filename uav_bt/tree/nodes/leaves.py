"""The format's leaves, and decorators that wait, watch a variable or evaluate a script."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, ClassVar, Final

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.node_ports import Written
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port, parse_reference
from uav_bt.tree.script.parser import parse_question, parse_script
from uav_bt.tree.script.values import assigned, truth
from uav_bt.tree.status import ANSWER_NAMES, FAILURE, RUNNING, SKIPPED, SUCCESS, Status
from uav_bt.tree.variables import After, Follow, Known, answered, as_child, both, joined


class AlwaysSuccess(Leaf):
    """Succeeds at once."""

    answers = (SUCCESS,)

    def update(self) -> Status:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(Leaf):
    """Fails at once."""

    answers = (FAILURE,)

    def update(self) -> Status:
        """Fail."""
        return FAILURE


_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")


def _check_variable(text: str) -> None:
    if parse_reference(text, "") is None and not _VARIABLE.fullmatch(text):
        raise ValueError(f"expected a variable's name, got '{text}'")


class ScriptNode(Leaf):
    """Runs a script and succeeds."""

    answers = (SUCCESS,)
    node_id = "Script"
    CODE = Port("code", str, doc="statements, separated by ';'", check=parse_script)
    ports = (CODE,)

    def update(self) -> Status:
        """Run the script."""
        parse_script(self.port(self.CODE)).run(self.environment)
        return SUCCESS


class ScriptCondition(Leaf):
    """Succeeds when its script comes to true, fails when to false."""

    CODE = Port("code", str, doc="a script that ends in true or false", check=parse_question)
    ports = (CODE,)
    condition = True

    def update(self) -> Status:
        """Run the script and judge."""
        code = self.port(self.CODE)
        holds = truth(parse_script(code).run(self.environment))
        self.feedback_message = "" if holds else f"'{code}' is false"
        return SUCCESS if holds else FAILURE


class Precondition(DecoratorNode):
    """Evaluates a script before it starts its child, and answers `else` when that is false."""

    IF = Port("if", str, doc="a script that ends in true or false", check=parse_question)
    ELSE = Port("else", str, default="FAILURE", doc="the answer otherwise", choices=ANSWER_NAMES)
    ports = (IF, ELSE)

    _started = False

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may not run."""
        after = follow(self.child, known)
        return joined(after, answered(known, self.literals.get(self.ELSE.name)))

    def update(self) -> Status:
        """Tick the child."""
        if not self._started:
            script = parse_script(self.port(self.IF))
            self._started = truth(script.run(self.environment))
            if not self._started:
                return Status[self.port(self.ELSE)]
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._started = False
        return status


class SetBlackboard(Leaf):
    """Writes a variable of the tree: a text, or a copy of another variable."""

    answers = (SUCCESS,)
    VALUE = Port("value", object, doc="the value, or {variable} to copy it", places=True)
    OUTPUT_KEY = Port("output_key", str, doc="the variable's name", check=_check_variable)
    ports = (VALUE, OUTPUT_KEY)

    def variables_written(self) -> Iterator[Written]:
        """Yield the variable, with its text or the variable that is copied."""
        text, name = (self.literals.get(port.name) for port in self.ports)
        kind, value = (str, text) if isinstance(text, str) else (object, None)
        copied = self.given_references.get(self.VALUE.name)
        yield Written(self.OUTPUT_KEY.name, name, kind, value, copied=copied, keeps_type=True)

    def needs_value(self, _: Port[Any]) -> bool:
        """Return True: what is to be copied must have a value."""
        return True

    def update(self) -> Status:
        """Write the variable; an existing variable keeps its type."""
        key = self.port(self.OUTPUT_KEY)
        value = self.port(self.VALUE)
        if isinstance(value, (int, float, str)):
            value = assigned(self.variables.get(key), value)
        self.variables[key] = value
        return SUCCESS


class UnsetBlackboard(Leaf):
    """Removes a variable of the tree."""

    answers = (SUCCESS,)
    KEY = Port("key", str, doc="the variable's name", check=_check_variable)
    ports = (KEY,)

    def variables_removed(self) -> Iterator[str]:
        """Yield the variable's name."""
        name = self.literals.get(self.KEY.name)
        if isinstance(name, str):
            yield name

    def update(self) -> Status:
        """Remove the variable; a missing one is not an error."""
        del self.variables[self.port(self.KEY)]
        return SUCCESS


# Times are sums of tick durations, so their last digits carry rounding errors.
_EPSILON_S = 1e-9


class Timeout(DecoratorNode):
    """Halts its child and fails when the child still runs after the given time."""

    MSEC = Port("msec", int, doc="milliseconds; 0: no limit", least=0)
    ports = (MSEC,)

    _deadline_s: float | None = None  # None: not started
    _expired = False

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may be halted in its first tick."""
        after = as_child(self, follow, known)
        return After(after.success, both(after.failure, known), after.skipped)

    def update(self) -> Status:
        """Tick the child."""
        limit_msec = self.port(self.MSEC)
        now_s = self.clock.now()
        if self._deadline_s is None:
            self._deadline_s = now_s + limit_msec / 1000 if limit_msec > 0 else float("inf")
            self._expired, self.feedback_message = False, ""
            self.set_status(RUNNING)
        if not self._expired and now_s >= self._deadline_s - _EPSILON_S:
            # As in the engine, the timer expires once; a child not running then is left alone.
            self._expired = True
            if self.child.node_status is RUNNING:
                self.child.reset()
                self._deadline_s = None
                self.feedback_message = f"stopped after {limit_msec / 1000:g} s"
                return FAILURE
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._deadline_s = None
        return status

    def _halt(self) -> None:
        self._deadline_s = None
        super()._halt()


class Delay(DecoratorNode):
    """Waits the given time before it ticks its child."""

    DELAY_MSEC = Port("delay_msec", int, doc="milliseconds", least=0)
    ports = (DELAY_MSEC,)

    variables_after = as_child

    _start_at_s: float | None = None  # None: not waiting

    def update(self) -> Status:
        """Return RUNNING during the time; then tick the child."""
        delay_msec = self.port(self.DELAY_MSEC)
        now_s = self.clock.now()
        if self._start_at_s is None:
            self._start_at_s = now_s + delay_msec / 1000
            self.set_status(RUNNING)
        if now_s < self._start_at_s - _EPSILON_S:
            return RUNNING
        status = self.child.execute_tick()
        if status is SUCCESS or status is FAILURE:
            self._start_at_s = None
        return status

    def _halt(self) -> None:
        self._start_at_s = None
        super()._halt()


class Sleep(Leaf):
    """Runs for the given time, then succeeds."""

    answers = (SUCCESS, RUNNING)
    MSEC = Port("msec", int, doc="milliseconds", least=0)
    ports = (MSEC,)

    _end_s = 0.0

    def initialise(self) -> None:
        """Store the end time."""
        self._end_s = self.clock.now() + self.port(self.MSEC) / 1000

    def update(self) -> Status:
        """Succeed when the time has passed."""
        return RUNNING if self.clock.now() < self._end_s - _EPSILON_S else SUCCESS


def _check_entry(text: object) -> None:
    if not isinstance(text, str) or not text.replace(".", "_").replace("-", "_").isidentifier():
        raise ValueError(f"expected a variable such as {{x}}, got '{text}'")


ENTRY = Port("entry", object, doc="the variable, as {name}", check=_check_entry)


class _Watches(Node):
    ports = (ENTRY,)

    _seen: object = None

    def _updated(self) -> bool:
        """Return whether the entry was written since the last check."""
        reference = self.reference(ENTRY)
        key = str(self.port(ENTRY)) if reference is None else reference.key
        on_board = reference is not None and reference.on_board
        board_key = key if on_board else self.variables.board_key(key)
        # What a write changes. The board counts no writes: a new one is another object or later.
        state: object
        if board_key is None:
            entry = self.variables.entry(key)
            state = None if entry is None else entry.writes
        else:
            held = self.mission.board.snapshot().get(board_key)
            state = None if held is None else (id(held[0]), held[1])
        if state is None:
            return False
        before, self._seen = self._seen, state
        return before != state


class WasEntryUpdated(_Watches, Leaf):
    """Succeeds when the variable was written since this node last looked."""

    answers = (SUCCESS, FAILURE)

    def update(self) -> Status:
        """Check the variable."""
        return SUCCESS if self._updated() else FAILURE


class _UnlessUpdated(_Watches, DecoratorNode):
    _otherwise: ClassVar[Status]

    variables_after = as_child

    _busy = False  # the child is running and is ticked without a check

    def update(self) -> Status:
        """Tick the child."""
        if not self._busy and not self._updated():
            return self._otherwise
        status = self.child.execute_tick()
        self._busy = status is RUNNING
        return status

    def _halt(self) -> None:
        # As in the engine, the halt is not passed on to the child.
        self._busy = False


class SkipUnlessUpdated(_UnlessUpdated):
    """Ticks its child when the variable was written since the last time, else skips."""

    _otherwise = SKIPPED

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may be skipped."""
        after = as_child(self, follow, known)
        return After(after.success, after.failure, known)


class WaitValueUpdate(_UnlessUpdated):
    """Ticks its child when the variable was written since the last time, else waits."""

    _otherwise = RUNNING
