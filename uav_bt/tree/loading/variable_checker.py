"""Checks of the types of variables across a whole file.

Only reads that must fail in flight are findings: none of the values that the variable gets fits its
reader. Python may also set the main tree's variables, so there only the file's values count.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.scopes import UNKNOWN, Read, Scope, Slot, Use, Write
from uav_bt.tree.loading.variable_uses import BoardUse, VariableUses
from uav_bt.tree.port import Port

_IN_SCRIPTS: Final = (int, float, str)
_PLAIN: Final = (bool, int, float, str)


def check_variables(document: Document, findings: Findings, roots: Iterable[str]) -> None:
    """Add a finding for each use of a variable that must fail.

    Args:
        document: the file.
        findings: collects the findings.
        roots: the trees that may be flown.
    """
    _VariableChecker(document, findings).check(roots)


class _VariableChecker:
    def __init__(self, document: Document, findings: Findings) -> None:
        self._findings = findings
        self._document = document
        self._uses = VariableUses(document)

    def check(self, roots: Iterable[str]) -> None:
        for scope in self._uses.find(roots):
            self._check_entries(scope)
            for slot in scope.slots():
                self._check_ports(slot)
                sources = slot.sources()
                for read in slot.reads:
                    if sources is not None:
                        self._check_read(slot, read, sources)
                    elif read.needed and not slot.created:
                        self._check_unwritten(scope, slot, read)
        for board_use in self._uses.on_board:
            self._check_board_use(board_use)

    def _note(self, use: Use, message: str) -> None:
        element = use.element
        whole = f"attribute '{use.attribute}'{message}"
        self._findings.note(element, whole, use.attribute, rule=Rule.VARIABLE)

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
                    f" takes {port.type.__name__}, but variable '{slot.name}' is "
                    f"{first.type.__name__} for {first_use}",
                )

    # --- variables --------------------------------------------------------------------------------

    def _check_read(self, slot: Slot, read: Read, sources: list[Write]) -> None:
        reasons = [_misfit(read.port, write) for write in sources]
        if not reasons or None in reasons:
            return
        given = sources[0].use
        if len(reasons) == 1 and given.element.path != read.use.element.path:
            # The reader is in a file that other missions use, too: the value is to be corrected.
            self._note(given, f" {reasons[0]}; {read.use} reads it")
            return
        more = f" (and {len(reasons) - 1} more like it)" if len(reasons) > 1 else ""
        takes = "" if read.port is None else f" takes {read.port.type.__name__}, but"
        self._note(
            read.use,
            f"{takes or ':'} variable '{slot.name}' {reasons[0]}, from {sources[0].use}{more}",
        )

    def _check_unwritten(self, scope: Scope, slot: Slot, read: Read) -> None:
        door = scope.door
        if door is None or slot.name.startswith("_"):
            return
        tree = scope.tree_id
        given = [name for name in scope.entries if name in door.attributes]
        unused = [name for name in given if name not in scope.touched]
        hint = did_you_mean(slot.name, scope.known_names())
        self._note(
            read.use,
            f": nothing writes variable '{slot.name}' of tree '{tree}', and {door.label} at "
            f"{door.path}:{door.position} gives no entry '{slot.name}'{hint}",
        )
        for name in unused:
            if did_you_mean(name, [slot.name]):
                self._findings.note(
                    door,
                    f"entry '{name}' is used by no node of tree '{tree}'"
                    f"{did_you_mean(name, [slot.name])}",
                    name,
                    rule=Rule.VARIABLE,
                )

    def _check_entries(self, scope: Scope) -> None:
        """Report entries that a description does not name; refuse those that nothing uses.

        Such an entry is probably a misspelt one, whose default would be flown.
        """
        door, described = scope.door, self._document.subtree_ports.get(scope.tree_id)
        if door is None or described is None:
            return
        obscure = any(slot.obscure for slot in scope.slots())
        for name in scope.entries:
            if name in described or name not in door.attributes:
                continue
            message = f"the tree is described without a port '{name}'"
            if obscure or name in scope.touched:
                self._findings.warn(door, message, name, rule=Rule.NODE_MODEL)
            else:
                hint = did_you_mean(name, described)
                message = f"{message} and does not use it{hint}"
                self._findings.note(door, message, name, rule=Rule.NODE_MODEL)

    # --- board keys by another name ---------------------------------------------------------------

    def _check_board_use(self, used: BoardUse) -> None:
        key, port = used.key, used.port
        what = f"'{used.name}' is board key '{key.name}'"
        if used.writes:
            self._note(used.use, f": {what}; only a leaf's output port writes that")
        elif port is None and not issubclass(key.type, _IN_SCRIPTS):
            self._note(
                used.use, f": {what}, which holds {key.type.__name__}, no number and no text"
            )
        elif port is not None and not key_fits(port, key):
            self._note(
                used.use,
                f" takes {port.words}, but {what}, which holds {key.type.__name__}",
            )


def _misfit(port: Port[Any] | None, write: Write) -> str | None:
    """Return why a written value can never be read, or None when it perhaps can."""
    kind = write.kind
    if kind is UNKNOWN:
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


_NUMBERS: Final = (int, float)
_TEXTUAL: Final = (str, int, float, bool)  # what `Port.read` makes of a text


def key_fits(port: Port[Any], key: Key[Any]) -> bool:
    """Return whether a port can be connected to a board key.

    Args:
        port: of a node.
        key: of the mission board.
    """
    if port.takes is not None:
        return issubclass(key.type, port.takes)
    if port.direction == "input":
        return issubclass(key.type, port.type) or (port.type is float and key.type is int)
    return issubclass(port.type, key.type) or (key.type is float and port.type is int)


def may_convert(kind: type, wanted: type) -> bool:
    """Return False when a value of one type can never be read as another; see `Port.read`.

    Args:
        kind: the type of the value.
        wanted: the type of the port.
    """
    if object in {kind, wanted}:
        return True
    if kind is str:
        return wanted in _TEXTUAL
    if kind is bool:
        return issubclass(bool, wanted) and wanted not in _NUMBERS
    if kind in _NUMBERS and wanted in _TEXTUAL:
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
