"""Uses of variables that must fail, in any mission that uses a tree.

Only reads that must fail in flight are findings: none of the values that the variable gets fits its
reader. Python may also set the main tree's variables, so there only the file's values count.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from uav_bt.board import Key
from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings, Position, Rule
from uav_bt.tree.loading.misfits import misfits
from uav_bt.tree.loading.parameters import VAR, Plain
from uav_bt.tree.loading.replacements import Built
from uav_bt.tree.loading.uses import Placeholder, Read, Slot, Use
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port
from uav_bt.tree.script.expressions import Assignment, Known, Name
from uav_bt.tree.script.values import ONLY_LEAVES_WRITE
from uav_bt.tree.variables import Variables

_IN_SCRIPTS: Final = (int, float, str)
_PLAIN: Final = (bool, int, float, str)


def check_variables(built: Built, document: Document, findings: Findings) -> None:
    """Add a finding for each use of a variable that must fail, and for unused outside values."""
    _VariableFaults(built, document, findings).check()


class _VariableFaults:
    def __init__(self, built: Built, document: Document, findings: Findings) -> None:
        self._built = built
        self._document = document
        self._findings = findings
        self._keys: Mapping[str, Key[Any]] = document.registry.board_keys
        self.uses = built.uses

    def check(self) -> None:
        for door in self.uses.doors.items():
            self._check_entries(*door)
        for slot in [*self.uses.slots.values()]:
            self._check_ports(slot)
            for read in slot.reads:
                if read.needed and not slot.created:
                    self._check_unwritten(slot, read)
        for node in self._built.tree.nodes():
            if not (isinstance(node, Placeholder) and node.hides):  # an unknown node
                self._check_board(node)
                self._check_scripts(node)
        for node, attribute, message, is_certain in misfits(self.uses):
            if is_certain:
                self._note(Use(node, attribute), f"attribute '{attribute}' {message}")
        self._check_given()

    def _note(
        self, use: Use, message: str, rule: Rule = Rule.VARIABLE, severity: str = ERROR
    ) -> None:
        element = self._built.parts[use.node.path].element
        self._findings.note(element, message, use.attribute, rule=rule, severity=severity)

    def _check_ports(self, slot: Slot) -> None:
        """Refuse ports of two types, as the engine does: the first that is made gives the type.

        A text may become anything, and objects of Python may be of several types at once.
        """
        typed = [(use, port) for use, port in slot.ports if port.type in _PLAIN]
        for use, port in typed[1:]:
            first_use, first = typed[0]
            if first.type not in {str, port.type}:
                self._note(
                    use,
                    f"attribute '{use.attribute}' takes {port.type.__name__}, but variable "
                    f"'{slot.name}' is {first.type.__name__} for {self.uses.words(first_use)}",
                )

    def _check_unwritten(self, slot: Slot, read: Read) -> None:
        door = self.uses.doors.get(slot.scope)
        if door is None or slot.name.startswith("_"):
            return
        part = self._built.parts[door.path]
        element, tree = part.element, door.tree_id
        used = self.uses.touched.get(slot.scope, set())
        created = [
            one.name
            for (scope, _), one in self.uses.slots.items()
            if scope is slot.scope and one.created
        ]
        hint = did_you_mean(slot.name, [*created, *door.shared, *door.board_keys])
        self._note(
            read.use,
            f"attribute '{read.use.attribute}': nothing writes variable '{slot.name}' of tree "
            f"'{tree}', and {element.label} at {element.path}:{element.position} gives no entry "
            f"'{slot.name}'{hint}",
        )
        for name in (*door.shared, *door.board_keys, *door.constants):
            hint = did_you_mean(name, [slot.name])
            if hint and name in element.attributes and name not in used:
                message = f"entry '{name}' is used by no node of tree '{tree}'{hint}"
                self._findings.note(element, message, name, rule=Rule.VARIABLE)

    def _check_entries(self, scope: Variables, door: SubTree) -> None:
        """Report entries that a description does not name; refuse those that nothing uses.

        Such an entry is probably a misspelt one, whose default would be flown.
        """
        described = self._document.subtree_ports.get(door.tree_id)
        if described is None:
            return
        obscure = any(slot.obscure for slot in self.uses.slots.values() if slot.scope is scope)
        element = self._built.parts[door.path].element
        used = self.uses.touched.get(scope, set())
        for name in (*door.shared, *door.board_keys, *door.constants):
            if name in described or name not in element.attributes:
                continue
            message = f"the tree is described without a port '{name}'"
            if obscure or name in used:
                self._findings.warn(element, message, name, rule=Rule.NODE_MODEL)
            else:
                hint = did_you_mean(name, described)
                message = f"{message} and does not use it{hint}"
                self._findings.note(element, message, name, rule=Rule.NODE_MODEL)

    # --- board keys -------------------------------------------------------------------------------

    def _check_board(self, node: Node) -> None:
        """Refuse uses of board keys that do not exist, hold another type, or are not written so."""
        for port in node.ports:
            at, given = node.reference(port), node.given_references.get(port.name)
            if given is not None and at is not None and at.on_board:
                name = f"@{at.key}" if given.on_board else given.key
                key = self._board_key(node, port.name, name)
                if key is not None and not key_fits(port, key):
                    message = f"attribute '{port.name}' takes {port.words}, but {_held(name, key)}"
                    self._note(Use(node, port.name), message, Rule.BOARD_KEY)
        for written in node.variables_written():
            if written.port is None and written.name is not None:
                self._refuse_write(node, written.attribute, written.name)
        for name in node.variables_removed():
            self._refuse_write(node, node.ports[0].name, name)
        if isinstance(node, SubTree):
            for entry, key_name in node.board_keys.items():
                self._board_key(node, entry, f"@{key_name}")

    def _check_scripts(self, node: Node) -> None:
        """Refuse uses of board keys in scripts."""
        for attribute, script in node.scripts():
            for part in script.parts:
                if isinstance(part, Assignment):
                    self._refuse_write(node, attribute, part.name)
                elif isinstance(part, Name | Known):
                    key = self._board_key(node, attribute, part.name)
                    if key and isinstance(part, Name) and not issubclass(key.type, _IN_SCRIPTS):
                        held = f"{_held(part.name, key)}, no number and no text"
                        message = f"attribute '{attribute}': {held}"
                        self._note(Use(node, attribute), message, Rule.BOARD_KEY)

    def _board_key(self, node: Node, attribute: str, name: str) -> Key[Any] | None:
        """Return the board key that a name is; refuse one that does not exist."""
        at = name[1:] if name.startswith("@") else node.variables.board_key(name)
        if at is None or at in self._keys:
            return None if at is None else self._keys[at]
        if name.startswith("@") and not self._document.registry.foreign_board:
            message = f"the board has no key '{at}'{did_you_mean(at, self._keys)}"
            self._note(Use(node, attribute), f"attribute '{attribute}': {message}", Rule.BOARD_KEY)
        return None

    def _refuse_write(self, node: Node, attribute: str, name: str) -> None:
        at = name[1:] if name.startswith("@") else node.variables.board_key(name)
        if at is not None and (at in self._keys or not self._document.registry.foreign_board):
            what = "a board key" if name == f"@{at}" else f"board key '{at}'"
            message = f"attribute '{attribute}': '{name}' is {what}; {ONLY_LEAVES_WRITE}"
            self._note(Use(node, attribute), message, Rule.BOARD_KEY)

    # --- values from outside ----------------------------------------------------------------------

    def _check_given(self) -> None:
        """Report values that no node can take, and those that may be lost."""
        parameters = self._document.parameters
        for name, value in (
            parameters.variables.items() if self._built.tree.name == self._document.main else ()
        ):
            place = parameters.places.get((VAR, name), Place(self._document.path, Position(1, 1)))
            for message, severity in self._faults_of_given(name, value):
                at = place.path, place.position
                self._findings.add(*at, message, severity=severity, rule=Rule.VARIABLE)

    def _replaced(self) -> set[str]:
        """Return the variables that the file names where a caller has given another value."""
        return {
            text.strip("{ }")
            for part in self._built.parts.values()
            for name, text in part.element.attributes.items()
            if part.given.get(name, text) != text
        }

    def _faults_of_given(self, name: str, value: Plain) -> Iterator[tuple[str, str]]:
        slot = self.uses.slots[self._built.tree.variables, name]
        touched = self.uses.touched.get(self._built.tree.variables, set()) | self._replaced()
        if name not in touched and not slot.obscure:
            hint = did_you_mean(name, touched)
            yield f"no node uses a variable '{name}' of tree '{self._document.main}'{hint}", ERROR
        for read in slot.reads:
            try:
                if read.port is not None:
                    read.port.read(value)
            except ValueError as error:
                yield f"variable '{name}': {error}; {self.uses.words(read.use)} reads it", ERROR
        for write in slot.writes:
            if write.creates and write.use is not None:
                what = f"{self.uses.words(write.use)} sets it, too, and replaces this value"
                yield f"variable '{name}': {what}", WARNING


def _held(name: str, key: Key[Any]) -> str:
    what = f"board key '{key.name}'"
    if name != f"@{key.name}":
        what = f"'{name}' is {what}, which"
    return f"{what} holds {key.type.__name__}"


def key_fits(port: Port[Any], key: Key[Any]) -> bool:
    """Return whether a port can be connected to a key of the mission board."""
    if port.takes is not None:
        return issubclass(key.type, port.takes)
    if port.direction == "input":
        return issubclass(key.type, port.type) or (port.type is float and key.type is int)
    return issubclass(port.type, key.type) or (key.type is float and port.type is int)
