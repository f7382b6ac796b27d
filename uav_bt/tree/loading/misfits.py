"""Values that a reader cannot take: texts for numbers, objects for scripts."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, NamedTuple

from uav_bt.board import MISSION_KEYS
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.uses import Slot, Uses, Values, Write, variable_at
from uav_bt.tree.node import Node
from uav_bt.tree.port import Port
from uav_bt.tree.script.expressions import Assignment, Expression, Name, Op, kind_of
from uav_bt.tree.script.parser import parse_text
from uav_bt.tree.script.values import ScriptError, number
from uav_bt.tree.variables import Variable

_PLAIN: Final = (bool, int, float, str)
_NUMBERS: Final = (int, float)
_IN_SCRIPTS: Final = (int, float, str)
_ARITHMETIC: Final = frozenset({"-x", "~x", "-", "*", "/", "&", "|", "^"})


class Misfit(NamedTuple):
    """A value that fails where it is read or written."""

    node: Node
    attribute: str
    message: str
    is_certain: bool = False  # no value of the variable fits


def misfits(uses: Uses) -> Iterator[Misfit]:
    """Yield the reads and writes that fail with a value of the tree."""
    asked = {at for node in uses.tree.nodes() for at in _asked_by(node)}
    for variable, slot in uses.slots.items():
        yield from _of_ports(uses, slot, is_asked=variable in asked)
        yield from _mixed(uses, slot)
    words = {key.name for key in MISSION_KEYS if key.type is str}  # keys with texts
    words |= {key.name for leaf in uses.tree.leaves() for key in leaf.writes if key.type is str}
    for node in uses.tree.nodes():
        for attribute, script in node.scripts():
            for part in script.parts:
                for message, is_certain in _of_part(uses, node, part, words):
                    yield Misfit(node, attribute, message, is_certain)


# --- ports ----------------------------------------------------------------------------------------


def _of_ports(uses: Uses, slot: Slot, *, is_asked: bool) -> Iterator[Misfit]:
    """Yield the ports that cannot read a value of a variable.

    A number that is out of a port's range may never get there, unless no other value does.
    """
    values, is_whole = slot.values()
    is_read = not is_asked and len({value.use.node for value in values if value.use}) == 1
    given = values if is_read else [value.of_any_round for value in values]
    for use, port in slot.ports if values else ():
        if port.direction == "output":
            continue
        found = [_refusal(port, value) for value in given]
        is_certain = is_whole and None not in found
        if not (is_certain or (is_read and port.type is str)):
            found = [_refusal(_without_range(port), value) for value in given]
        for value, why in zip(values, found, strict=True):
            if why is None:
                continue
            if len(values) == 1 and value.use and uses.in_other_file(use, value.use):
                # Other missions use the reader's file, too: the value is to be corrected.
                at, message = value.use, f"holds {value.words}; {uses.words(use)} reads it"
            else:
                holds = f"{'holds' if is_certain else 'may hold'} {uses.value_words(value)}"
                at, message = use, f"takes {port.words}, but variable '{slot.name}' {holds}"
            yield Misfit(*at, f"{message}: {why}" if why else message, is_certain)
            break


def _without_range(port: Port[Any]) -> Port[Any]:
    check = None if port.takes is None else port.check  # the elements of a queue
    return replace(port, least=None, most=None, choices=(), check=check)


def _refusal(port: Port[Any], write: Write) -> str | None:
    """Return why a port cannot read a value, if it cannot; "" for a wrong type."""
    if port.takes is not None and not issubclass(write.kind, port.takes):
        return None if write.kind is object else ""
    if write.value is None or (port.type is object and port.takes is None):
        return None if _may_convert(write.kind, port.type) else ""
    try:
        port.read(write.value)
    except ValueError as error:
        return str(error)
    return None


def _may_convert(kind: type, wanted: type) -> bool:
    """Return False when a value of one type can never be read as another; see `Port.read`."""
    if object in {kind, wanted}:
        return True
    if kind is str:
        return wanted in _PLAIN
    if kind is bool:
        return issubclass(bool, wanted) and wanted not in _NUMBERS
    if kind in _NUMBERS and wanted in _PLAIN:
        return True
    # A value declared as one type may be an instance of the other, too.
    is_open = any(inspect.isabstract(one) or _is_protocol(one) for one in (kind, wanted))
    return is_open or issubclass(kind, wanted) or issubclass(wanted, kind)


def _is_protocol(kind: type) -> bool:
    return getattr(kind, "_is_protocol", False)


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


# --- scripts --------------------------------------------------------------------------------------


def _of_part(
    uses: Uses, node: Node, part: Expression, words: set[str]
) -> Iterator[tuple[str, bool]]:
    """Yield the messages on values that a part of a script cannot use, and whether none fits."""
    if isinstance(part, Name):
        values, is_whole = _named(uses, node, part, words)
        known = [one for one in values if one.kind is not object]
        bad = [one for one in known if not issubclass(one.kind, _IN_SCRIPTS)]
        if bad:
            is_certain = is_whole and len(bad) == len(values)
            holds = f"{'holds' if is_certain else 'may hold'} {uses.value_words(bad[0])}"
            yield f"variable '{part.name}' {holds}, no number and no text", is_certain
    for operand in (one for one in _numbers_in(part) if isinstance(one, Name)):
        for value in _named(uses, node, operand, words)[0]:
            if _is_word(value) or (value.kind is str and not _compares(part)):
                held = uses.value_words(value)
                yield f"needs a number, but '{operand.name}' may hold {held}", False
                return


def _named(uses: Uses, node: Node, part: Name, words: set[str]) -> Values:
    """Return the values that a name in a script may have, and whether these are all."""
    name = part.name
    key = name[1:] if name.startswith("@") else node.variables.board_key(name)
    if key is not None:
        return [Write(None, str)] if key in words else [], False
    variable = variable_at(node, name)
    return ([], False) if variable is None else uses.slots.get(variable, Slot(*variable)).values()


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


def _mixed(uses: Uses, slot: Slot) -> Iterator[Misfit]:
    """Yield the script that gives a variable a number where it may hold a text, or reverse."""
    values = slot.values()[0]
    for value in (one for one in slot.writes if one.keeps_type):
        other = next((one for one in values if _clash(value, one)), None)
        if value.use is not None and other is not None:
            message = (
                f"writes {value.words} to variable '{slot.name}', which may hold "
                f"{uses.value_words(other)}, and keeps the type of its first value"
            )
            yield Misfit(*value.use, message)
            return


def _clash(value: Write, other: Write) -> bool:
    """Return whether a script cannot write a value where a variable holds another."""
    if other.kind is str:
        return value.kind in _NUMBERS
    return other.kind in _NUMBERS and _is_word(value)


def _is_word(write: Write) -> bool:
    """Return whether a value is a text that no script can take for a number."""
    return write.kind is str and (write.value is None or not _is_number(write.value))


def _is_number(value: object) -> bool:
    try:
        number(value)
    except ScriptError:
        return False
    return True
