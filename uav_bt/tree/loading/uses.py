"""Writers and readers of each variable of a tree, before the flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

from uav_bt.board import MISSION_KEYS, Key
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.node_ports import Written
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.nodes.base import ControlNode
from uav_bt.tree.port import Port, Reference
from uav_bt.tree.script.expressions import Assignment, Name, constant_value, kind_of
from uav_bt.tree.script.parser import SCRIPTS, Script
from uav_bt.tree.variables import Variable, Variables

_MAX_VALUES: Final = 100  # of one variable


class Placeholder(ControlNode):
    """Stands where a file is wrong; something unknown may happen there."""

    min_children = 0
    hides = True  # whether it may write any variable of its tree


class Use(NamedTuple):
    """An attribute that uses a variable."""

    node: Node
    attribute: str


@dataclass(frozen=True, eq=False)
class Write:
    """Something that may write a variable."""

    use: Use | None  # None: the value comes from outside the file
    kind: type  # of the value; object: unknown
    value: Any = None  # where the file has it
    copied: Slot | None = None  # the variable whose value it is
    creates: bool = True  # False: only changes a variable that exists
    keeps_type: bool = False  # an existing variable keeps its type
    is_element: bool = False  # one of the values that a loop gives

    @property
    def of_any_round(self) -> Write:
        """The write without the value where a loop gives several."""
        return replace(self, value=None) if self.is_element else self

    @property
    def words(self) -> str:
        """The value, or its type."""
        return self.kind.__name__ if self.value is None else repr(self.value)


@dataclass(frozen=True, eq=False)
class Read:
    """Something that reads a variable."""

    use: Use
    port: Port[Any] | None  # None: a script
    needed: bool  # without a value the reader fails
    named: bool = True  # the file names the variable; False: the port's default does


@dataclass(eq=False)
class Slot:
    """A variable."""

    scope: Variables
    name: str
    writes: list[Write] = field(default_factory=list)
    reads: list[Read] = field(default_factory=list)
    ports: list[tuple[Use, Port[Any]]] = field(default_factory=list)  # as they are made
    obscure: bool = False  # something writes it that the file does not show
    given: bool = False  # its first value comes from outside the file

    @property
    def created(self) -> bool:
        """True when something gives it its first value, or may."""
        return self.obscure or self.given or any(write.creates for write in self.writes)

    @property
    def is_shown(self) -> bool:
        """True when all values of the variable can be read in the tree file."""
        changes = any(not (write.creates or write.keeps_type) for write in self.writes)
        return self.created and not (self.obscure or self.given or changes)

    def values(self) -> Values:
        """Return the writes of its values, copies followed back, and whether these are all."""
        found: list[Write] = []
        seen: dict[int, Slot] = {}
        waiting = [self]
        while waiting and len(seen) + len(found) < _MAX_VALUES:
            slot = waiting.pop()
            if id(slot) in seen:
                continue
            seen[id(slot)] = slot
            for write in slot.writes:
                if write.copied is not None:
                    waiting.append(write.copied)
                elif write.creates or write.keeps_type:
                    found.append(write)
        return found, not waiting and all(slot.is_shown for slot in seen.values())


Values = tuple[list[Write], bool]  # what writes them, and whether these are all


class Uses:
    """The variables of a tree, with all that writes and reads them."""

    def __init__(self, tree: MissionTree) -> None:
        self.tree = tree
        self._keys: dict[str, Key[Any]] = {key.name: key for key in MISSION_KEYS}
        for leaf in tree.leaves():
            self._keys |= {key.name: key for key in (*leaf.reads, *leaf.writes)}
        self.slots: dict[Variable, Slot] = {}
        self.doors: dict[Variables, SubTree] = {}  # by the scope of the tree inside
        self.touched: dict[Variables, set[str]] = {}  # names that something inside uses
        obscured: list[Variables] = []
        for name, value in tree.variables.snapshot().items():
            slot = self._slot(tree.variables, name)
            slot.given = True
            slot.writes.append(Write(None, type(value), value))
        for node in tree.nodes():
            if isinstance(node, Placeholder) and node.hides:
                obscured.append(node.variables)
            obscured += self._add(node)
        for scope in obscured:
            self._obscure(scope)

    def place(self, scope: Variables, name: str) -> Slot | None:
        """Return the variable that a name is; None for a board key."""
        holder, inner = scope.location(name)
        while scope is not holder and scope.parent is not None:
            self.touched.setdefault(scope, set()).add(name)
            name, scope = scope.remapped.get(name, name), scope.parent
        self.touched.setdefault(holder, set()).add(inner)
        return None if inner in holder.board else self._slot(holder, inner)

    def _slot(self, scope: Variables, name: str) -> Slot:
        return self.slots.setdefault((scope, name), Slot(scope, name))

    def _obscure(self, scope: Variables) -> None:
        """Note that anything may be written from here."""
        for (where, _), slot in self.slots.items():
            slot.obscure |= where is scope
        if (door := self.doors.get(scope)) is not None:
            for name in door.shared.values():
                if (outer := self.place(door.variables, name)) is not None:
                    outer.obscure = True
            if door.autoremap:
                self._obscure(door.variables)

    def unset(self) -> dict[str, Use]:
        """Return the variables of the main tree that are read and that nothing sets, by name."""
        first: dict[str, Use] = {}
        for slot in self.slots.values():
            if slot.scope is self.tree.variables and not slot.created:
                for read in slot.reads:
                    if read.needed or read.named:
                        first.setdefault(slot.name, read.use)
        return first

    def words(self, use: Use) -> str:
        """Return node and attribute of a use, with their place where there is a file."""
        node, place = use.node, self.tree.places.get(use.node.path)
        where = "" if place is None else f", at {place.path}:{place.at(use.attribute)}"
        label = f"'{node.path}'" if place is None else place.label
        return f"{label}, attribute '{use.attribute}'{where}"

    def value_words(self, write: Write) -> str:
        """Return a value, or its type, and what writes it."""
        return write.words + ("" if write.use is None else f", from {self.words(write.use)}")

    def in_other_file(self, one: Use, other: Use) -> bool:
        """Return whether two uses stand in different files."""
        places = [self.tree.places.get(use.node.path) for use in (one, other)]
        return len({place.path for place in places if place is not None}) > 1

    # --- one node ---------------------------------------------------------------------------------

    def _add(self, node: Node) -> Iterator[Variables]:
        """Add what a node writes and reads; yield a scope of which it may write any variable."""
        for attribute, script in node.scripts():
            self._script(script, Use(node, attribute))
        if isinstance(node, SubTree):
            self._enter(node)
        for port in node.ports_over(len(node.children)):
            at = node.given_references.get(port.name)
            if at is not None and not at.on_board:
                self._port(node, port, at)
            if port.check in SCRIPTS and at is not None:
                yield node.variables  # a script that only the flight shows
        for written in node.variables_written():
            if written.name is None:
                yield node.variables
            else:
                self._write(node, written, written.name)
        for name in node.variables_removed():
            self._remove(node, name)

    def _enter(self, node: SubTree) -> None:
        inner = node.child.variables
        self.doors[inner] = node
        for name, value in node.constants.items():
            write = Write(Use(node, name), type(value), value)
            self._slot(inner, name).writes.append(write)

    def _write(self, node: Node, written: Written, name: str) -> None:
        slot, use = self.place(node.variables, name), Use(node, written.attribute)
        if slot is not None:
            kind, copied = self._source(node, written.copied, written.kind)
            for value in written.elements or (written.value,):
                more = (copied, True, written.keeps_type, bool(written.elements))
                slot.writes.append(Write(use, kind, value, *more))

    def _remove(self, node: Node, name: str) -> None:
        slot, door = self.place(node.variables, name), self.doors.get(node.variables)
        is_entry = door and door.autoremap and name in door.constants and not name.startswith("_")
        if slot is not None and is_entry:
            slot.obscure = True  # without the entry, the name is the outer tree's

    def _source(self, node: Node, at: Reference | None, kind: type) -> tuple[type, Slot | None]:
        """Return the type of a value that may be a copy, and the variable that is copied."""
        if at is None:
            return kind, None
        slot = None if at.on_board else self.place(node.variables, at.key)
        if slot is not None:
            return object, slot
        key = self._keys.get(at.key if at.on_board else node.variables.board_key(at.key) or "")
        return object if key is None else key.type, None

    def _port(self, node: Node, port: Port[Any], at: Reference) -> None:
        slot, use = self.place(node.variables, at.key), Use(node, port.name)
        if slot is None:
            return
        slot.ports.append((use, port))
        if port.direction != "output":
            named = is_named(port, at)
            needed = named and port.required and port.type is not object
            slot.reads.append(Read(use, port, needed, named))

    def _script(self, script: Script, use: Use) -> None:
        for part in script.parts:
            if isinstance(part, Assignment):
                self._assignment(part, use)
            elif isinstance(part, Name) and part.name not in script.asked_known:
                self._read(part.name, use, needed=any(part is one for one in script.certain))
        for statement in script.statements:
            if isinstance(statement, Assignment) and statement.sign != ":=":
                self._read(statement.name, use, needed=True)

    def _read(self, name: str, use: Use, *, needed: bool) -> None:
        slot = self.place(use.node.variables, name) if _is_variable(name, use.node) else None
        if slot is not None:
            slot.reads.append(Read(use, None, needed))

    def _assignment(self, part: Assignment, use: Use) -> None:
        slot = None if part.name.startswith("@") else self.place(use.node.variables, part.name)
        if slot is None:
            return
        at = None
        if isinstance(part.value, Name) and _is_variable(part.value.name, use.node):
            at = Reference(part.value.name, on_board=False)
        kind, copied = self._source(use.node, at, kind_of(part.value) or object)
        creates, value = part.sign == ":=", constant_value(part.value)
        keeps_type = part.sign in {":=", "="}
        slot.writes.append(Write(use, kind, value, copied, creates, keeps_type))


def _is_variable(name: str, node: Node) -> bool:
    return not name.startswith("@") and name not in node.variables.enum_members


def is_named(port: Port[Any], at: Reference) -> bool:
    """Return whether a node names a variable or key at a port, and not only the port's default."""
    return port.default is Port.REQUIRED or port.bound_default != at


def variable_at(node: Node, name: str) -> Variable | None:
    """Return the variable that a name in a node's script is; None for a board key or a constant."""
    variables = node.variables
    if name.startswith("@") or name in variables.enum_members:
        return None
    return None if variables.board_key(name) is not None else variables.location(name)
