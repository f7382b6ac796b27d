"""Leaves that answer by a script, in place of those that fly: for tests and dry runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

from uav_bt.errors import ValueRangeError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.port import Port
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status

_LETTERS: Final = {status.letter: status for status in Status if status is not Status.IDLE}
_SCRIPT: Final = re.compile(r"(?P<once>[RSFK]*)(?:\((?P<again>[RSFK]+)\))?")


@dataclass(frozen=True)
class AnswerScript:
    """Answers of a scripted leaf, one letter a tick: R running, S success, F failure, K skipped.

    One letter is used up each time the leaf is ticked, whether an activation begins, goes on or was
    halted in between. After the last letter the last one is answered for ever (`RRS`); letters in
    brackets at the end are answered over and over instead (`F(RS)`). BehaviorTree.CPP's reference
    traces answer so; the brackets are an addition.
    """

    once: tuple[Status, ...]  # answered first
    again: tuple[Status, ...]  # then over and over; never empty

    @classmethod
    def parse(cls, text: str) -> AnswerScript:
        """Return the script that a text is; spaces between the letters mean nothing."""
        letters = "".join(text.split())
        match = _SCRIPT.fullmatch(letters)
        if match is None or not letters:
            raise ValueRangeError(
                f"a script has the letters R (running), S (success), F (failure) and K (skipped), "
                f"those that repeat in brackets at its end, as in 'RRS' or 'F(RS)'; got '{text}'"
            )
        once = tuple(_LETTERS[letter] for letter in match["once"])
        again = tuple(_LETTERS[letter] for letter in match["again"] or match["once"][-1])
        return cls(once, again)

    def answer(self, tick: int) -> Status:
        """Return the answer to a tick, counted from 0."""
        if tick < len(self.once):
            return self.once[tick]
        return self.again[(tick - len(self.once)) % len(self.again)]

    @property
    def statuses(self) -> frozenset[Status]:
        """The answers that it gives."""
        return frozenset((*self.once, *self.again))


ALL_LEAVES: Final = "*"
"""Selector of mocks: all leaves that have no other answers, except those of the format."""


@dataclass(frozen=True)
class Mock:
    """What takes the place of a leaf: its answers, and the values that it writes."""

    answers: str | None = None  # see `AnswerScript`; None: those of a less exact selector
    outputs: Mapping[str, object] = field(default_factory=dict)  # by port; written on each SUCCESS
    place: Place | None = None  # where it was written; default: in the code

    def over(self, other: Mock | None) -> Mock:
        """Return this mock, completed by that of a less exact selector."""
        if other is None:
            return self
        answers = other.answers if self.answers is None else self.answers
        return Mock(answers, {**other.outputs, **self.outputs}, self.place)


class ScriptedLeaf(Leaf):
    """Answers by its script, a text or a mock with outputs, and does nothing else."""

    answers = (SUCCESS, FAILURE, RUNNING, SKIPPED)

    def __init__(
        self, name: str | None = None, script: str | Mock = "S", /, **given: object
    ) -> None:
        super().__init__(name, **given)
        mock = Mock(script) if isinstance(script, str) else script
        self.script, self.outputs = self.check(mock)
        self._ticks = 0

    @classmethod
    def check(cls, mock: Mock) -> tuple[AnswerScript, dict[Port[Any], Any]]:
        """Return the script and the output values that a mock gives to leaves of this class."""
        if mock.answers is None:
            raise ValueRangeError(f"it has outputs, but {cls.node_id} has no answers")
        script = AnswerScript.parse(mock.answers)
        if cls.condition and RUNNING in script.statuses:
            raise ValueRangeError(
                f"the condition {cls.node_id} answers at once, "
                f"so its script cannot have an R; got '{mock.answers}'"
            )
        ports = {port.name: port for port in cls.ports if port.direction != "input"}
        outputs = {}
        for name, value in mock.outputs.items():
            if name not in ports:
                known = ", ".join(ports) or "none"
                raise ValueRangeError(f"{cls.node_id} has no output '{name}' (known: {known})")
            try:
                outputs[ports[name]] = ports[name].convert(value)
            except ValueError as error:
                raise ValueRangeError(f"output '{name}': {error}") from error
        return script, outputs

    def update(self) -> Status:
        """Answer the next letter."""
        status = self.script.answer(self._ticks)
        self._ticks += 1
        if status is SUCCESS:
            for port, value in self.outputs.items():
                self.set_port(port, value)
        return status


def undeclared_answers(node: type[Leaf], mock: Mock) -> str | None:
    """Return the error of a mock with answers that the leaf never gives; None for a good one.

    A mock may always answer SKIPPED, for a condition that skips the leaf.
    """
    script = AnswerScript.parse(mock.answers or "")
    if not (others := script.statuses - {SKIPPED, *node.answers}):
        return None
    never = " or ".join(sorted(status.name for status in others))
    known = " or ".join(status.name for status in node.answers)
    return f"{node.node_id} never answers {never}, only {known}; got '{mock.answers}'"


_DECLARED: Final = (
    *("__doc__", "node_id", "ports", "reads", "writes", "condition"),
    *("moves", "points", "takes_off", "lands"),
)


@cache
def mock_class(node: type[Leaf]) -> type[ScriptedLeaf]:
    """Return a class of scripted leaves that stand in for a class of leaves.

    They have its id, kind, ports and board keys, and run none of its code.
    """
    body = {name: getattr(node, name) for name in _DECLARED}
    return type(f"Scripted{node.__name__}", (ScriptedLeaf,), body)


def subtree_mock(tree_id: str, entries: Iterable[str]) -> type[ScriptedLeaf]:
    """Return a class of scripted leaves, of which one stands for a SubTree and all inside.

    Args:
        tree_id: of the SubTree.
        entries: their names; they are the ports.
    """
    ports = tuple(Port(name, object, direction="inout") for name in entries)
    return type(f"Scripted{tree_id}", (ScriptedLeaf,), {"node_id": tree_id, "ports": ports})
