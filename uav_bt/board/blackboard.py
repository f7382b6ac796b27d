"""The mission's blackboard: typed keys, ages, and declared access.

The blackboard of py_trees is one store for the whole process. This one belongs to one mission, so
missions are isolated and a test starts empty.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

from uav_bt.errors import BoardAccessError, did_you_mean
from uav_bt.protocols import Clock

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True)
class Key(Generic[T]):
    """A typed entry of the board."""

    name: str  # `{@name}` in a tree file, `@name` in a script
    type: type[T]  # of its values
    doc: str  # description in one line
    unit: str = ""  # of plain numbers; typed values have units in their field names
    writer: str = ""  # name of the writer, for people
    max_age_s: float = math.inf  # a value older than this reads as None


@dataclass(frozen=True)
class Reading(Generic[T_co]):
    """Result of a read: a fresh value, or None and the age of the stale one."""

    value: T_co | None
    age_s: float  # since capture; inf when never written

    @property
    def known(self) -> bool:
        """Whether there is a fresh value."""
        return self.value is not None


class Blackboard:
    """The store of one mission. Leaves access it through a `BoardView`."""

    def __init__(self, clock: Clock, keys: Iterable[Key[Any]]) -> None:
        self._clock = clock
        self._keys: dict[str, Key[Any]] = {}
        self._entries: dict[str, tuple[Any, float]] = {}  # value, capture time
        for key in keys:
            self.declare(key)

    def declare(self, key: Key[Any]) -> None:
        """Add a key. Adding it again is allowed; another key of that name is not."""
        if self._keys.setdefault(key.name, key) != key:
            raise BoardAccessError(f"board key '{key.name}' is declared twice, differently")

    @property
    def keys(self) -> dict[str, Key[Any]]:
        """All declared keys by name (a copy)."""
        return dict(self._keys)

    def key(self, name: str) -> Key[Any]:
        """Return a declared key by name."""
        if name not in self._keys:
            raise BoardAccessError(f"unknown board key '{name}'{did_you_mean(name, self._keys)}")
        return self._keys[name]

    def write(self, key: Key[T], value: T, captured_s: float | None = None) -> None:
        """Store a value; `captured_s` is its capture time (default: now)."""
        known = self._keys.get(key.name)
        if known is not key and known != key:  # most are the same object
            raise BoardAccessError(f"board key '{key.name}' was never declared on this board")
        accepted = (int, float) if key.type is float else key.type
        no_number = isinstance(value, bool) and key.type not in {bool, object}
        if not isinstance(value, accepted) or no_number:
            got = type(value).__name__
            raise BoardAccessError(f"board key '{key.name}' holds {key.type.__name__}, got {got}")
        now = self._clock.now()
        self._entries[key.name] = (value, now if captured_s is None else captured_s)

    def read(self, key: Key[T]) -> Reading[T]:
        """Return the value when it is fresh, and its age."""
        entry = self._entries.get(key.name)
        if entry is None:
            return Reading(None, math.inf)
        value, captured_s = entry
        age_s = self._clock.now() - captured_s
        # The epsilon allows for rounding: ages are differences of sums of ticks.
        fresh = age_s <= key.max_age_s + 1e-9
        return Reading(cast("T", value) if fresh else None, age_s)

    def value(self, key: Key[T]) -> T | None:
        """Return the value if it is fresh, else None: `read` without the age, but faster."""
        entry = self._entries.get(key.name)
        if entry is None or key.max_age_s == math.inf:
            return None if entry is None else cast("T", entry[0])
        return self.read(key).value

    def forget(self, key: Key[Any]) -> None:
        """Drop a value, as if it had never been written."""
        self._entries.pop(key.name, None)

    def snapshot(self) -> dict[str, tuple[Any, float]]:
        """Return (value, capture time) by key name, for records and displays."""
        return dict(self._entries)


class BoardView:
    """Access of one leaf to the board, limited to its declared keys."""

    def __init__(
        self,
        board: Blackboard,
        owner: str,
        *,
        reads: Iterable[Key[Any]] = (),
        writes: Iterable[Key[Any]] = (),
    ) -> None:
        self._board = board
        self._owner = owner
        self._writes = frozenset(key.name for key in writes)
        self._reads = self._writes.union(key.name for key in reads)

    def read(self, key: Key[T]) -> Reading[T]:
        """Return a declared key's value when it is fresh, and its age."""
        self._check(key, "reads", self._reads)
        return self._board.read(key)

    def value(self, key: Key[T]) -> T | None:
        """Return a declared key's value when it is fresh, else None."""
        self._check(key, "reads", self._reads)
        return self._board.value(key)

    def write(self, key: Key[T], value: T, captured_s: float | None = None) -> None:
        """Write a declared key; `captured_s` is its capture time (default: now)."""
        self._check(key, "writes", self._writes)
        try:
            self._board.write(key, value, captured_s)
        except BoardAccessError as error:
            raise BoardAccessError(f"leaf '{self._owner}': {error}") from error

    def forget(self, key: Key[Any]) -> None:
        """Drop a declared key's value."""
        self._check(key, "writes", self._writes)
        self._board.forget(key)

    def _check(self, key: Key[Any], what: str, declared: frozenset[str]) -> None:
        if key.name not in declared:
            fault = f"{what} board key '{key.name}' without declaring it: add it to its `{what}`"
            raise BoardAccessError(f"leaf '{self._owner}' {fault}")
