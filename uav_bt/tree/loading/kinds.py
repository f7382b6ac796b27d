"""Values that a reader may be unable to take: texts for numbers, objects for scripts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from uav_bt.board import MISSION_KEYS
from uav_bt.tree.flow import Variable
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.uses import Use, Uses, variable_at
from uav_bt.tree.loading.variable_faults import may_convert
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.port import Port
from uav_bt.tree.script import parse_text
from uav_bt.tree.script.expressions import (
    Assignment,
    Expression,
    Name,
    Op,
    kind_of,
)
from uav_bt.tree.script.values import ScriptError, number

_NUMBERS: Final = (int, float)
_IN_SCRIPTS: Final = (int, float, str)
_ARITHMETIC: Final = frozenset({"-x", "~x", "-", "*", "/", "&", "|", "^"})


@dataclass(frozen=True)
class _Value:
    """A value that a variable may get."""

    kind: type
    value: Any = None  # where the file has it
    use: Use | None = None  # that writes it; None: its first value
    keeps_type: bool = False  # an existing variable keeps its type
    is_element: bool = False  # one of a loop's

    @property
    def is_word(self) -> bool:
        """Whether it is a text that no script can take for a number."""
        return self.kind is str and (self.value is None or not _is_number(self.value))

    def __str__(self) -> str:
        what = self.kind.__name__ if self.value is None else repr(self.value)
        return what if self.use is None else f"{what} (from '{self.use.node.name}')"


@dataclass(frozen=True)
class Misfit:
    """A value that fails where it is read or written."""

    node: Node
    attribute: str
    message: str


def misfits(tree: MissionTree) -> Iterator[Misfit]:
    """Yield the reads and writes that fail with a value of the tree."""
    values = _Values(tree)
    for node in tree.nodes():
        for port in node.ports:
            for message in values.misfits_of_port(node, port):
                yield Misfit(node, port.name, message)
        for attribute, script in node.scripts():
            for part in script.parts:
                for message in values.misfits_of_part(node, part):
                    yield Misfit(node, attribute, message)
    yield from values.mixed()


class _Values:
    """The values that each variable of a tree gets."""

    def __init__(self, tree: MissionTree) -> None:
        self._values: dict[Variable, list[_Value]] = {}
        self._asked = {at for node in tree.nodes() for at in _asked_by(node)}
        self._words = {key.name for key in MISSION_KEYS if key.type is str}  # keys with texts
        for leaf in tree.leaves():
            self._words |= {key.name for key in leaf.writes if key.type is str}
        for variable, slot in Uses(tree).slots.items():
            entry = variable[0].entry(variable[1])
            found = [] if entry is None else [_Value(type(entry.value), entry.value)]
            for write in slot.writes:
                is_sure = not write.keeps_type or write.kind is not object
                if not write.is_entry and is_sure and (write.creates or write.keeps_type):
                    for value in write.elements or (write.value,):
                        kept = (write.keeps_type, bool(write.elements))
                        found.append(_Value(write.kind, value, write.use, *kept))
            self._values[variable] = found

    def _of(self, variable: Variable) -> list[_Value]:
        return self._values.get(variable, [])

    # --- readers ----------------------------------------------------------------------------------

    def misfits_of_port(self, node: Node, port: Port[Any]) -> Iterator[str]:
        """Yield the messages on values that a port cannot read."""
        at = node.reference(port)
        if at is None or at.on_board or port.direction == "output":
            return
        variable = node.variables.location(at.key)
        values = self._of(variable)
        writers = {None if value.use is None else value.use.node for value in values}
        sure = variable not in self._asked and len(writers) == 1
        for value in values:
            why = _refusal(port, value) if sure else ""
            known = value if sure or not value.is_element else replace(value, value=None)
            if why or not _fits(port, known):
                yield f"takes {port.words}, but variable '{at.key}' may hold {value}{why}"
                return

    def misfits_of_part(self, node: Node, part: Expression) -> Iterator[str]:
        """Yield the messages on values that a part of a script cannot use."""
        if isinstance(part, Name):
            for value in self._named(node, part):
                if value.kind is not object and not issubclass(value.kind, _IN_SCRIPTS):
                    yield f"variable '{part.name}' may hold {value}, no number and no text"
                    return
        for operand in _numbers_in(part):
            for value in self._named(node, operand):
                if value.is_word or (value.kind is str and not _compares(part)):
                    yield f"needs a number, but '{_name(operand)}' may hold {value}"
                    return

    def _named(self, node: Node, part: Expression) -> list[_Value]:
        if not isinstance(part, Name):
            return []
        name = part.name
        key = name[1:] if name.startswith("@") else node.variables.board_key(name)
        if key is not None:
            return [_Value(str)] if key in self._words else []
        variable = variable_at(node, name)
        return [] if variable is None else self._of(variable)

    def mixed(self) -> Iterator[Misfit]:
        """Yield scripts that give a variable a number where it may hold a text, or reverse."""
        for (_, name), values in self._values.items():
            for value in values:
                other = next((one for one in values if _clash(value, one)), None)
                if value.keeps_type and value.use is not None and other is not None:
                    message = (
                        f"writes {value} to variable '{name}', which may hold {other} and "
                        "keeps the type of its first value"
                    )
                    yield Misfit(*value.use, message)
                    break


def _numbers_in(part: Expression) -> tuple[Expression, ...]:
    """Return the operands that must be numbers; of a comparison, also texts that are numbers."""
    if isinstance(part, Assignment) and part.sign not in {":=", "="}:
        part = Op(part.sign[0], (Name(part.name), part.value))
    if not isinstance(part, Op):
        return ()
    mixes = any(kind_of(operand) in _NUMBERS for operand in part.parts)
    compares = _compares(part) or part.sign == "+"
    return part.parts if part.sign in _ARITHMETIC or (compares and mixes) else ()


def _compares(part: Expression) -> bool:
    return isinstance(part, Op) and part.links != ()


def _name(part: Expression) -> str:
    return part.name if isinstance(part, Name) else ""


def _clash(value: _Value, other: _Value) -> bool:
    """Return whether a script cannot write a value where a variable holds another."""
    if other.kind is str:
        return value.kind in _NUMBERS
    return other.kind in _NUMBERS and value.is_word


def _fits(port: Port[Any], value: _Value) -> bool:
    """Return whether a port can read a value of this type; its range is not asked."""
    if port.takes is not None and not issubclass(value.kind, port.takes):
        return value.kind is object
    if value.value is None or (port.type is object and port.takes is None):
        return may_convert(value.kind, port.type)
    try:
        check = None if port.takes is None else port.check  # the elements of a queue
        replace(port, least=None, most=None, choices=(), check=check).read(value.value)
    except ValueError:
        return False
    return True


def _refusal(port: Port[Any], value: _Value) -> str:
    """Return why the port's own check, such as that of a place, refuses a text; else nothing."""
    if isinstance(value.value, str) and port.type is str:
        try:
            port.read(value.value)
        except ValueError as error:
            return f": {error}"
    return ""


def _asked_by(node: Node) -> Iterator[Variable]:
    """Yield the variables by whose values a node may keep others from being read."""
    decides = not isinstance(node, Leaf) or node.condition
    for port in node.ports:
        at = node.reference(port)
        asks = decides and port.check is None and port.direction != "output"
        if asks and at is not None and not at.on_board:
            yield node.variables.location(at.key)
    texts = {port.name for port in node.ports if port.check is parse_text}
    for attribute, script in node.scripts():
        if attribute not in texts:
            for part in script.parts:
                variable = variable_at(node, part.name) if isinstance(part, Name) else None
                if variable is not None:
                    yield variable


def _is_number(value: object) -> bool:
    try:
        number(value)
    except ScriptError:
        return False
    return True
