"""Uses of variables that must fail, in any mission that uses a tree.

Only reads that must fail in flight are findings: none of the values that the variable gets fits its
reader. Python may also set the main tree's variables, so there only the file's values count.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any, Final

from uav_bt.board import Key
from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.attributes import key_fits
from uav_bt.tree.loading.build import Built
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings, Position, Rule
from uav_bt.tree.loading.parameters import VAR, Plain
from uav_bt.tree.loading.uses import BoardUse, Read, Slot, Use, Uses, Write
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port
from uav_bt.tree.variables import Variables

_IN_SCRIPTS: Final = (int, float, str)
_PLAIN: Final = (bool, int, float, str)
_NUMBERS: Final = (int, float)


def check_variables(built: Built, document: Document, findings: Findings) -> Uses:
    """Add a finding for each use of a variable that must fail, and for unused outside values."""
    faults = _VariableFaults(built, document, findings)
    faults.check()
    return faults.uses


class _VariableFaults:
    def __init__(self, built: Built, document: Document, findings: Findings) -> None:
        self._built = built
        self._document = document
        self._findings = findings
        self._keys: Mapping[str, Key[Any]] = document.registry.board_keys
        self.uses = Uses(built.tree, self._keys)

    def check(self) -> None:
        for door in self.uses.doors.items():
            self._check_entries(*door)
        for slot in [*self.uses.slots.values()]:
            self._check_ports(slot)
            sources = slot.sources()
            for read in slot.reads:
                if sources is not None:
                    self._check_read(slot, read, sources)
                elif read.needed and not slot.created:
                    self._check_unwritten(slot, read)
        for board_use in self.uses.on_board:
            self._check_board_use(board_use)
        self._check_given()

    def _note(
        self, use: Use, message: str, rule: Rule = Rule.VARIABLE, severity: str = ERROR
    ) -> None:
        element = self._built.parts[use.node.path].element
        self._findings.note(element, message, use.attribute, rule=rule, severity=severity)

    def _words(self, use: Use) -> str:
        """Return node, attribute and place of a use."""
        element = self._built.parts[use.node.path].element
        place = f"{element.path}:{element.at(use.attribute)}"
        return f"{element.label}, attribute '{use.attribute}', at {place}"

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
                    f"'{slot.name}' is {first.type.__name__} for {self._words(first_use)}",
                )

    def _check_read(self, slot: Slot, read: Read, sources: list[Write]) -> None:
        reasons = [_misfit(read.port, write) for write in sources]
        if not reasons or None in reasons:
            return
        use, given = read.use, sources[0].use
        files = [self._built.parts[one.node.path].element.path for one in (use, given)]
        if len(reasons) == 1 and files[0] != files[1]:
            # The reader is in a file that other missions use, too: the value is to be corrected.
            self._note(
                given, f"attribute '{given.attribute}' {reasons[0]}; {self._words(use)} reads it"
            )
            return
        more = f" (and {len(reasons) - 1} more like it)" if len(reasons) > 1 else ""
        takes = "" if read.port is None else f" takes {read.port.type.__name__}, but"
        self._note(
            use,
            f"attribute '{use.attribute}'{takes or ':'} variable '{slot.name}' {reasons[0]}, from "
            f"{self._words(given)}{more}",
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

    def _check_board_use(self, used: BoardUse) -> None:
        key, port = self._keys.get(used.key), used.port
        lead = f"attribute '{used.use.attribute}'"
        what = f"'{used.name}' is board key '{used.key}'"
        if key is None:
            return  # refused at the SubTree
        if used.writes:
            self._note(used.use, f"{lead}: {what}; only a leaf's output port writes that")
        elif port is None and not issubclass(key.type, _IN_SCRIPTS):
            held = key.type.__name__
            self._note(used.use, f"{lead}: {what}, which holds {held}, no number and no text")
        elif port is not None and not key_fits(port, key):
            held = key.type.__name__
            self._note(used.use, f"{lead} takes {port.words}, but {what}, which holds {held}")

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
        slot = self.uses.slots[self.uses.main, name]
        touched = self.uses.touched.get(self.uses.main, set()) | self._replaced()
        if name not in touched and not slot.obscure:
            hint = did_you_mean(name, touched)
            yield f"no node uses a variable '{name}' of tree '{self._document.main}'{hint}", ERROR
        for read in slot.reads:
            try:
                if read.port is not None:
                    read.port.read(value)
            except ValueError as error:
                yield f"variable '{name}': {error}; {self._words(read.use)} reads it", ERROR
        for write in slot.writes:
            if write.creates:
                what = f"{self._words(write.use)} sets it, too, and replaces this value"
                yield f"variable '{name}': {what}", WARNING


def _misfit(port: Port[Any] | None, write: Write) -> str | None:
    """Return why a written value can never be read, or None when it perhaps can."""
    kind = write.kind
    if kind is object:
        return None
    if port is None:
        fits = any(_related(kind, known) for known in _IN_SCRIPTS)
        return None if fits else f"holds {kind.__name__}, no number and no text"
    numeric = not isinstance(write.value, str)
    if write.value is None or (numeric and port.type is object):
        return None if may_convert(kind, port.type) else f"holds {kind.__name__}"
    try:
        port.read(write.value)
    except ValueError as error:
        return f"holds a value that does not fit ({error})"
    return None


def may_convert(kind: type, wanted: type) -> bool:
    """Return False when a value of one type can never be read as another; see `Port.read`."""
    if object in {kind, wanted}:
        return True
    if kind is str:
        return wanted in _PLAIN
    if kind is bool:
        return issubclass(bool, wanted) and wanted not in _NUMBERS
    if kind in _NUMBERS and wanted in _PLAIN:
        return True
    return _related(kind, wanted)


def _related(kind: type, other: type) -> bool:
    """Return whether a value declared as one type may be an instance of the other, too."""
    return (
        issubclass(kind, other)
        or issubclass(other, kind)
        or any(
            inspect.isabstract(one) or getattr(one, "_is_protocol", False) for one in (kind, other)
        )
    )
