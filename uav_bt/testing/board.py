"""The board of a test, which raises where a flight's board returns None."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, TypeVar

from uav_bt.board.blackboard import Blackboard, Key, Reading
from uav_bt.errors import BoardAccessError, did_you_mean
from uav_bt.protocols import Clock

T = TypeVar("T")


class StrictBlackboard(Blackboard):
    """A board that raises when a stale value or an undeclared key is read.

    In flight a stale value reads as None, and leaves must handle it. In a test it mostly means that
    the test forgot to refresh its board, and would pass for the wrong reason.
    """

    def __init__(self, clock: Clock, keys: Iterable[Key[Any]]) -> None:
        super().__init__(clock, keys)
        self.allow_stale = False

    def read(self, key: Key[T]) -> Reading[T]:
        """Return a fresh value, or an empty reading if none was ever written."""
        declared = self._keys.get(key.name)
        if declared is None:
            raise BoardAccessError(
                f"board key '{key.name}' was never declared on this board"
                f"{did_you_mean(key.name, self._keys)}"
            )
        if declared != key:
            raise BoardAccessError(
                f"board key '{key.name}' was declared as {declared.type.__name__}, "
                f"and is read as another key, of {key.type.__name__}"
            )
        reading = super().read(key)
        if reading.value is None and reading.age_s < math.inf and not self.allow_stale:
            raise BoardAccessError(
                f"board key '{key.name}' is stale in this test: {reading.age_s:.2f} s old, at most "
                f"{key.max_age_s:.2f} s; write it again after advancing the clock, "
                "or set allow_stale to test how the leaf copes"
            )
        return reading


class BenchBoard:
    """The test's unrestricted access to the board, by key."""

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    def __setitem__(self, key: Key[T], value: T) -> None:
        """Write a value, captured at its `captured_s` or else now."""
        self._board.declare(key)
        self._board.write(key, value, captured_s=getattr(value, "captured_s", None))

    def __getitem__(self, key: Key[T]) -> T:
        """Return the last value, of any age; KeyError if there is none."""
        value: T = self._board.snapshot()[key.name][0]
        return value

    def __contains__(self, key: Key[Any]) -> bool:
        """Return whether the key has a value."""
        return key.name in self._board.snapshot()

    def __delitem__(self, key: Key[Any]) -> None:
        """Delete the key's value."""
        self._board.forget(key)
