"""The format's leaves, except those that wait, and the decorator that evaluates a script."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from uav_bt.tree.flow import After, Follow, Known, Written, answered, joined
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port, parse_reference
from uav_bt.tree.script import Script, parse_question, parse_script
from uav_bt.tree.script.values import assigned, truth
from uav_bt.tree.status import ANSWER_NAMES, FAILURE, SUCCESS, Status


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


class _Code:
    """A script port's value, parsed again only when its text has changed."""

    def __init__(self) -> None:
        self._script: Script | None = None

    def of(self, text: str) -> Script:
        """Return the parsed script."""
        if self._script is None or self._script.source != text:
            self._script = parse_script(text)
        return self._script


class ScriptNode(Leaf):
    """Runs a script and succeeds."""

    answers = (SUCCESS,)
    node_id = "Script"
    CODE = Port("code", str, doc="statements, separated by ';'", check=parse_script)
    ports = (CODE,)

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._code = _Code()

    def update(self) -> Status:
        """Run the script."""
        self._code.of(self.port(self.CODE)).run(self.environment)
        return SUCCESS


class ScriptCondition(Leaf):
    """Succeeds when its script comes to true, fails when to false."""

    CODE = Port("code", str, doc="a script that ends in true or false", check=parse_question)
    ports = (CODE,)
    condition = True

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self._code = _Code()

    def update(self) -> Status:
        """Run the script and judge."""
        result = self._code.of(self.port(self.CODE)).run(self.environment)
        return SUCCESS if truth(result) else FAILURE


class Precondition(DecoratorNode):
    """Evaluates a script before it starts its child, and answers `else` when that is false.

    Args:
        name: the instance's name; default: the node's id.
        child: the child.
        given: values of the ports.
    """

    IF = Port("if", str, doc="a script that ends in true or false", check=parse_question)
    ELSE = Port("else", str, default="FAILURE", doc="the answer otherwise", choices=ANSWER_NAMES)
    ports = (IF, ELSE)

    _started = False

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super().__init__(name, child, **given)
        self._code = _Code()

    def variables_after(self, follow: Follow, known: Known) -> After:
        """Follow the child, which may not run."""
        after = follow(self.child, known)
        return joined(after, answered(known, self.literals.get(self.ELSE.name)))

    def update(self) -> Status:
        """Tick the child."""
        if not self._started:
            script = self._code.of(self.port(self.IF))
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
        text = self.literals.get(self.VALUE.name)
        yield Written(
            self.OUTPUT_KEY.name,
            self.literals.get(self.OUTPUT_KEY.name),
            str if isinstance(text, str) else object,
            text if isinstance(text, str) else None,
            copied=self.given_references.get(self.VALUE.name),
            keeps_type=True,
        )

    def needs_value(self, port: Port[Any]) -> bool:
        """Return True: what is to be copied must have a value."""
        del port
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
