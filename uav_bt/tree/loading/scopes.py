"""Variables of a tree file before the flight, with their writers and readers.

A `Scope` holds the variables (`Slot`) of one use of a tree. A SubTree element is its door: entries
of the element connect names inside to names, board keys or constants outside. A `Scope` resolves
names as `Variables` does in flight. A slot is obscure when the file does not show all writers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.tree.loading.source import Element
from uav_bt.tree.nodes.base import entry_value
from uav_bt.tree.port import Port

_MAX_SOURCES: Final = 100  # of one variable


class UNKNOWN:
    """The type of a value of which nothing is known."""


@dataclass(frozen=True, eq=False)
class Use:
    """Where in a file a variable is used."""

    element: Element
    attribute: str

    def __str__(self) -> str:
        """Return node, attribute and place."""
        element = self.element
        return (
            f"{element.label}, attribute '{self.attribute}', "
            f"at {element.path}:{element.at(self.attribute)}"
        )


@dataclass(frozen=True)
class Write:
    """Something that may write a variable."""

    use: Use
    kind: type  # of the value, or UNKNOWN
    value: int | float | str | None = None  # where the file has it
    copied: Slot | None = None  # the variable whose value it is
    creates: bool = True  # False: only changes a variable that exists


@dataclass(frozen=True)
class Read:
    """Something that reads a variable."""

    use: Use
    port: Port[Any] | None  # None: a script
    needed: bool  # without a value the reader fails
    named: bool = True  # the file names the variable; False: the port's default does

    @property
    def asks(self) -> bool:
        """Whether the reader asks for a value although its port may have a default."""
        typed = self.port is not None and self.port.type is not object
        return self.needed or (self.named and typed)


@dataclass(eq=False)
class Slot:
    """A variable of one scope."""

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

    def sources(self) -> list[Write] | None:
        """Return what gives it its values, copies followed back; None when that is not known.

        Of equal writes the first stands for all. More than `_MAX_SOURCES` different ones count as
        not known.
        """
        found: dict[tuple[type, int | float | str | None], Write] = {}
        seen: set[int] = set()
        waiting = [self]
        while waiting:
            slot = waiting.pop()
            if id(slot) in seen:
                continue
            seen.add(id(slot))
            if not slot.created or slot.obscure or slot.given:
                return None
            changed = any(not write.creates for write in slot.writes)
            for write in slot.writes:
                if not write.creates:
                    continue  # it keeps the type that there is
                if write.copied is not None:
                    waiting.append(write.copied)
                else:
                    kept = replace(write, value=None) if changed else write
                    found.setdefault((kept.kind, kept.value), kept)
                if len(seen) + len(found) > _MAX_SOURCES:
                    return None
        return list(found.values())


class Scope:
    """The variables of one use of a tree.

    Args:
        tree_id: the tree.
        parent: the scope of the tree that uses it; None for a tree that is flown itself.
        door: the SubTree element that uses it.
        remapped: names here that are other names in the parent.
        board: names here that are keys of the mission board.
        constants: first values of names here.
        autoremap: every name that is not private is the parent's.
    """

    def __init__(
        self,
        tree_id: str,
        parent: Scope | None = None,
        door: Element | None = None,
        *,
        remapped: Mapping[str, str] | None = None,
        board: Mapping[str, Key[Any] | None] | None = None,
        constants: Mapping[str, str] | None = None,
        autoremap: bool = False,
    ) -> None:
        self.tree_id = tree_id
        self.parent = parent
        self.door = door
        self.touched: set[str] = set()  # names that something inside uses
        self._remapped = dict(remapped or {})
        self._board = dict(board or {})
        self._autoremap = autoremap
        self._slots: dict[str, Slot] = {}
        self._constants = dict(constants or {})
        if door is not None:
            for name, text in self._constants.items():
                value = entry_value(text)
                write = Write(Use(door, name), type(value), value)
                self._slots[name] = Slot(name, [write])

    def place(self, name: str) -> Slot | Key[Any] | None:
        """Return the variable or the board key that a name is; None for an unknown key."""
        self.touched.add(name)
        if name in self._board:
            return self._board[name]
        if self.parent is not None:
            if name in self._remapped:
                return self.parent.place(self._remapped[name])
            if self._autoremap and not name.startswith("_") and name not in self._constants:
                return self.parent.place(name)
        return self._slots.setdefault(name, Slot(name))

    def give(self, name: str) -> None:
        """Note that a variable gets its first value from outside the file."""
        self._slots.setdefault(name, Slot(name)).given = True

    def obscure(self) -> None:
        """Note that anything may be written from here."""
        for slot in self._slots.values():
            slot.obscure = True
        if self.parent is None:
            return
        for name in self._remapped.values():
            outer = self.parent.place(name)
            if isinstance(outer, Slot):
                outer.obscure = True
        if self._autoremap:
            self.parent.obscure()

    def uncovers(self, name: str) -> bool:
        """Return whether removing a name here makes it the parent's."""
        return self._autoremap and name in self._constants and not name.startswith("_")

    def slots(self) -> Iterator[Slot]:
        """Iterate over the variables that live here."""
        yield from self._slots.values()

    def known_names(self) -> list[str]:
        """Return the names that have a value here."""
        own = [name for name, slot in self._slots.items() if slot.created]
        return [*own, *self._remapped, *self._board]

    @property
    def entries(self) -> list[str]:
        """The names that the SubTree element gives."""
        return [*self._remapped, *self._board, *self._constants]
