"""The variables of a tree, and how they pass through nodes.

There is one scope per tree, with doors to the tree that contains it. The check of early reads
follows the first tick through a tree. It asks each node which variables have a value after its
answers, given those that have one before (`NodePorts.variables_after`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

from uav_bt.errors import BoardAccessError, did_you_mean


@dataclass(slots=True)
class Entry:
    """A variable. `writes` counts how often it was written, so that a change can be noticed."""

    value: Any
    writes: int = 1


class Variables:
    """One tree's scope.

    Args:
        parent: the scope of the tree that contains this one as a `SubTree`.
        remapped: names here that are other names in the parent.
        board: names here that are keys of the mission board.
        constants: first values of names here. They are this scope's own, even when all other names
            are the parent's.
        autoremap: every name that is not private (`_x`) is the parent's of the same name.
    """

    def __init__(
        self,
        parent: Variables | None = None,
        remapped: Mapping[str, str] | None = None,
        board: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        *,
        autoremap: bool = False,
    ) -> None:
        self.parent = parent
        self.remapped = dict(remapped or {})
        self.board = dict(board or {})
        self.autoremap = autoremap
        # Of enumerations: constants of scripts, the same in all scopes of a tree.
        self.enum_members: dict[str, int] = {} if parent is None else parent.enum_members
        self.entries = {key: Entry(value) for key, value in (constants or {}).items()}
        # Where names lead, found once: the walk through the doors is most of a read.
        self._places: dict[str, tuple[Variables, str]] = {}

    def location(self, key: str) -> tuple[Variables, str]:
        """Return the scope that holds a variable, and its name there."""
        place = self._places.get(key)
        if place is not None:
            return place
        scope, name, lasting = self, key, True
        while scope.parent is not None and name not in scope.board:
            if name in scope.remapped:
                name = scope.remapped[name]
            elif not scope.autoremap or name.startswith("_"):
                break
            elif name in scope.entries:
                lasting = False  # a constant that is removed uncovers the parent's variable
                break
            scope = scope.parent
        if lasting:
            self._places[key] = (scope, name)
        return scope, name

    def board_key(self, key: str) -> str | None:
        """Return the key of the mission board that a name is, or None for a variable."""
        scope, name = self.location(key)
        return scope.board.get(name)

    def entry(self, key: str) -> Entry | None:
        """Return a variable, or None when it was never written or is a board key."""
        scope, name = self._places.get(key) or self.location(key)
        return scope.entries.get(name)

    def __getitem__(self, key: str) -> Any:
        """Return a variable's value; KeyError with a suggestion when it was never written."""
        entry = self.entry(key)
        if entry is None:
            raise KeyError(f"variable '{key}' has no value{did_you_mean(key, self)}")
        return entry.value

    def get(self, key: str, default: Any = None) -> Any:
        """Return a variable's value, or the default when it was never written."""
        entry = self.entry(key)
        return default if entry is None else entry.value

    def __setitem__(self, key: str, value: Any) -> None:
        """Write a variable; BoardAccessError when the name is a key of the mission board."""
        entries, name = self._own(key)
        entry = entries.get(name)
        if entry is None:
            entries[name] = Entry(value)
        else:
            entry.value = value
            entry.writes += 1

    def __delitem__(self, key: str) -> None:
        """Remove a variable, if it exists."""
        entries, name = self._own(key)
        entries.pop(name, None)

    def _own(self, key: str) -> tuple[dict[str, Entry], str]:
        scope, name = self.location(key)
        if name in scope.board:
            raise BoardAccessError(
                f"variable '{key}' is the board key {{@{scope.board[name]}}}: only a leaf's "
                "output port writes that"
            )
        return scope.entries, name

    def __contains__(self, key: str) -> bool:
        """Return whether the variable has a value."""
        return self.entry(key) is not None

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names written in this scope."""
        return iter(tuple(self.entries))

    def snapshot(self) -> dict[str, Any]:
        """Return name and value of everything written in this scope."""
        return {name: entry.value for name, entry in self.entries.items()}


# --- how they pass through nodes ------------------------------------------------------------------


Variable = tuple[Variables, str]
"""A variable: the scope that holds it, and its name there."""

Known = frozenset[Variable]
Out = Known | None  # the variables with a value after an answer; None: it never answers so


class After(NamedTuple):
    """The variables with a value after each answer."""

    success: Out
    failure: Out
    skipped: Out = None


Follow = Callable[[Any, Known], After]
"""Returns the variables with a value after a node, given those before it."""


def both(one: Out, other: Out) -> Out:
    """Return the variables with a value after either of two answers."""
    if one is None or other is None:
        return one if other is None else other
    return one & other


def joined(*found: After) -> After:
    """Return the variables with a value after any one of several nodes."""
    nothing = After(None, None)
    return After(*(reduce(both, outs) for outs in zip(nothing, *found, strict=True)))


def answered(known: Known, answer: object) -> After:
    """Return the variables with a value after an answer, by its name; None: any answer."""
    return After(*(known if answer in {name, None} else None for name in _ANSWERS))


_ANSWERS = ("SUCCESS", "FAILURE", "SKIPPED")


def as_child(node: Any, follow: Follow, known: Known) -> After:
    """Follow the only child, whose answers are the node's."""
    return follow(node.children[0], known)


def in_order(children: Iterable[Any], follow: Follow, known: Known, *, falls_back: bool) -> After:
    """Follow children of which each runs after those before it have succeeded, or all failed."""
    reached: Out = known
    ended: Out = None
    skips = True
    for child in children:
        if reached is None:
            break
        success, failure, skipped = follow(child, reached)
        ended = both(ended, success if falls_back else failure)
        reached = both(failure if falls_back else success, skipped)
        skips = skips and skipped is not None
    skipped = known if skips else None
    return After(ended, reached, skipped) if falls_back else After(reached, ended, skipped)
