"""Search for the writers and readers of each variable of a tree file, with subtrees in place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from uav_bt.board.blackboard import Key
from uav_bt.errors import InputError
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.elements import expanded_class, node_id_of, tree_within
from uav_bt.tree.loading.scopes import UNKNOWN, Read, Scope, Slot, Use, Write
from uav_bt.tree.loading.source import MAX_DEPTH, MAX_NODES, Element
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import SetBlackboard, UnsetBlackboard
from uav_bt.tree.port import Port, Reference, bind_ports, parse_reference
from uav_bt.tree.script import SCRIPTS, Script, ScriptError, parsed_by
from uav_bt.tree.script.expressions import Assignment, Name, constant_value, kind_of


@dataclass(frozen=True)
class BoardUse:
    """A use of a board key by the name of a subtree's variable."""

    key: Key[Any]
    name: str  # of the variable
    use: Use
    port: Port[Any] | None = None  # None: a script, or a node that writes variables by name
    writes: bool = False  # without a port


class VariableUses:
    """Walks the trees of a document as they will be flown.

    Args:
        document: the file.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._registry = document.registry
        self._board_keys = document.registry.board_keys
        self.on_board: list[BoardUse] = []
        self._scopes: list[Scope] = []
        self._obscured: list[Scope] = []
        self._count = 0

    def find(self, roots: Iterable[str]) -> Iterator[Scope]:
        """Iterate over all scopes of trees and of their subtrees.

        Trees that contain themselves are followed once, and of trees that multiply without bound
        only a part; the loader refuses both.

        Args:
            roots: the trees that may be flown.
        """
        for tree_id in roots:
            if tree_id in self._document.trees:
                scope = Scope(tree_id)
                for name in self._document.parameters.variables:
                    scope.give(name)
                self._enter(scope, (tree_id,))
        for scope in self._obscured:
            scope.obscure()
        yield from self._scopes

    def _enter(self, scope: Scope, chain: tuple[str, ...]) -> None:
        self._scopes.append(scope)
        for child in self._document.trees[scope.tree_id].children:
            self._visit(child, scope, chain)

    def _visit(self, element: Element, scope: Scope, chain: tuple[str, ...]) -> None:
        self._count += 1
        if self._count > MAX_NODES:
            self._obscured.append(scope)
            return
        given = self._document.entries(element)
        for name in CONDITION_ATTRIBUTES.intersection(given):
            self._script(given.pop(name), scope, Use(element, name))
        tree_id = tree_within(element, self._registry)
        if tree_id is not None:
            self._subtree(element, tree_id, given, scope, chain)
            return
        node_id = node_id_of(element)
        if node_id in self._registry:
            self._node(element, self._registry[node_id], given, scope)
        else:
            self._obscured.append(scope)
        for child in element.children:
            self._visit(child, scope, chain)

    # --- subtrees ---------------------------------------------------------------------------------

    def _subtree(
        self,
        element: Element,
        tree_id: str,
        given: dict[str, str],
        outer: Scope,
        chain: tuple[str, ...],
    ) -> None:
        remapped: dict[str, str] = {}
        board: dict[str, Key[Any] | None] = {}
        constants: dict[str, str] = {}
        for name, text in given.items():
            try:
                reference = parse_reference(text, name)
            except ValueError:
                reference = Reference(name, on_board=True)  # refused; say nothing more about it
            if reference is None:
                constants[name] = text
            elif reference.on_board:
                board[name] = self._board_keys.get(reference.key)
            else:
                remapped[name] = reference.key
        scope = Scope(
            tree_id,
            outer,
            element,
            remapped=remapped,
            board=board,
            constants=constants,
            autoremap=expanded_class(element, self._registry) is None and autoremaps(element),
        )
        known = scope.tree_id in self._document.trees and scope.tree_id not in chain
        if not known or len(chain) > MAX_DEPTH:
            self._obscured.append(scope)
        else:
            self._enter(scope, (*chain, scope.tree_id))

    # --- nodes ------------------------------------------------------------------------------------

    def _node(
        self, element: Element, node: type[Node], given: dict[str, str], scope: Scope
    ) -> None:
        ports = node.ports_over(len(element.children))
        bound, _ = bind_ports(ports, dict(given))
        for port in ports:
            value = bound.get(port.name)
            use = Use(element, port.name)
            if isinstance(value, Reference):
                if not value.on_board:
                    self._port(port, value, use, scope, explicit=port.name in given)
                if port.check in SCRIPTS:
                    self._obscured.append(scope)  # a script that only the flight shows
            elif port.check in SCRIPTS and isinstance(value, str):
                self._script(value, scope, use, port.check)
        if node is SetBlackboard:
            self._set(bound, element, scope)
        elif node is UnsetBlackboard:
            self._unset(bound, Use(element, UnsetBlackboard.KEY.name), scope)

    def _port(
        self, port: Port[Any], at: Reference, use: Use, scope: Scope, *, explicit: bool
    ) -> None:
        slot = scope.place(at.key)
        if slot is None:
            return
        if isinstance(slot, Key):
            self.on_board.append(BoardUse(slot, at.key, use, port))
            return
        slot.ports.append((use, port))
        if port.direction != "output":
            needed = explicit and port.required and port.type is not object
            slot.reads.append(Read(use, port, needed, named=explicit))
        if port.direction != "input":
            slot.writes.append(Write(use, UNKNOWN if port.type is object else port.type))

    def _set(self, bound: dict[str, Any], element: Element, scope: Scope) -> None:
        name = bound.get(SetBlackboard.OUTPUT_KEY.name)
        value = bound.get(SetBlackboard.VALUE.name)
        use = Use(element, SetBlackboard.OUTPUT_KEY.name)
        if not isinstance(name, str):
            self._obscured.append(scope)
            return
        slot = self._written(name, use, scope)
        if slot is None:
            return
        write = Write(use, str, value) if isinstance(value, str) else Write(use, UNKNOWN)
        if isinstance(value, Reference):
            source = self._board_keys.get(value.key) if value.on_board else scope.place(value.key)
            if isinstance(source, Key):
                write = Write(use, source.type)
            elif isinstance(source, Slot):
                write = Write(use, UNKNOWN, copied=source)
        slot.writes.append(write)

    def _unset(self, bound: dict[str, Any], use: Use, scope: Scope) -> None:
        name = bound.get(use.attribute)
        if isinstance(name, str):
            slot = self._written(name, use, scope)
            if slot is not None and scope.uncovers(name):
                slot.obscure = True

    def _written(self, name: str, use: Use, scope: Scope) -> Slot | None:
        slot = scope.place(name)
        if isinstance(slot, Key):
            self.on_board.append(BoardUse(slot, name, use, writes=True))
            return None
        return slot

    # --- scripts ----------------------------------------------------------------------------------

    def _script(self, text: str, scope: Scope, use: Use, check: object = None) -> None:
        try:
            script = parsed_by(check, text)
        except (ScriptError, InputError):
            return
        for part in script.walk():
            if isinstance(part, Assignment) and part.name.startswith("@"):
                continue  # on another engine's board; the checker refuses all others
            if isinstance(part, Assignment):
                self._assignment(part, scope, use)
            elif (
                isinstance(part, Name)
                and self._is_variable(part)
                and part.name not in script.asked_known
            ):
                self._name(part, scope, use, needed=id(part) in script.certain)
        self._changed(script, scope, use)

    def _is_variable(self, name: Name) -> bool:
        return not name.name.startswith("@") and name.name not in self._document.enum_members

    def _name(self, name: Name, scope: Scope, use: Use, *, needed: bool) -> None:
        slot = scope.place(name.name)
        if isinstance(slot, Key):
            self.on_board.append(BoardUse(slot, name.name, use))
        elif slot is not None:
            slot.reads.append(Read(use, None, needed))

    def _changed(self, script: Script, scope: Scope, use: Use) -> None:
        for statement in script.statements:
            if not isinstance(statement, Assignment) or statement.name.startswith("@"):
                continue
            if statement.sign != ":=":
                slot = scope.place(statement.name)
                if isinstance(slot, Slot):
                    slot.reads.append(Read(use, None, needed=True))

    def _assignment(self, part: Assignment, scope: Scope, use: Use) -> None:
        slot = self._written(part.name, use, scope)
        if slot is None:
            return
        source = None
        if isinstance(part.value, Name) and self._is_variable(part.value):
            source = scope.place(part.value.name)
        kind = kind_of(part.value) or UNKNOWN
        if isinstance(source, Key):
            kind, source = source.type, None
        slot.writes.append(
            Write(
                use,
                kind,
                value=constant_value(part.value),
                copied=source,
                creates=part.sign == ":=",
            )
        )


def unset_slots(document: Document, roots: Iterable[str]) -> Iterator[Slot]:
    """Iterate over the variables of trees that get no value in the file.

    Variables of their subtrees are left out.

    Args:
        document: the file.
        roots: the trees that may be flown.
    """
    for scope in VariableUses(document).find(roots):
        for slot in scope.slots() if scope.door is None else ():
            if not slot.created:
                yield slot
