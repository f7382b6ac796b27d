"""The board of a test: isolated, and an error where a flight would cope."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, TypeVar

from uav_bt.board.blackboard import Blackboard, Key, Reading
from uav_bt.errors import BoardAccessError, did_you_mean
from uav_bt.protocols import Clock

T = TypeVar("T")


class StrictBlackboard(Blackboard):
    """A board on which reading a stale value is an error, as is reading an undeclared key.

    In flight a stale value reads as none, and a leaf copes. In a test it mostly means that the test
    forgot to refresh its board, and would pass for the wrong reason.

    Args:
        clock: the mission's; it dates what is written.
        keys: which keys there are from the start.
    """

    def __init__(self, clock: Clock, keys: Iterable[Key[Any]]) -> None:
        super().__init__(clock, keys)
        self.allow_stale = False

    def read(self, key: Key[T]) -> Reading[T]:
        """Return a fresh value, or a reading of nothing for one that was never written.

        Raises:
            BoardAccessError: the key is not declared, or was declared with another type, or the
                value is stale and `allow_stale` is False.
        """
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
    """The test's own access to the board: everything, by key."""

    def __init__(self, board: Blackboard) -> None:
        self._board = board

    def __setitem__(self, key: Key[T], value: T) -> None:
        """Write as the key's writer would, captured now or at the value's own `captured_s`.

        Raises:
            BoardAccessError: the value has another type than the key.
        """
        self._board.declare(key)
        self._board.write(key, value, captured_s=getattr(value, "captured_s", None))

    def __getitem__(self, key: Key[T]) -> T:
        """Return what was written last, however old.

        Raises:
            KeyError: nothing was.
        """
        value: T = self._board.snapshot()[key.name][0]
        return value

    def __contains__(self, key: Key[Any]) -> bool:
        """Return whether the key holds anything."""
        return key.name in self._board.snapshot()

    def __delitem__(self, key: Key[Any]) -> None:
        """Drop what the key holds."""
        self._board.forget(key)
