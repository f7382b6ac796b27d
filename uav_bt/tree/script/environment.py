"""What a script sees: the variables of its tree, enumerations, and the mission board to read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from uav_bt.board.blackboard import Blackboard
from uav_bt.errors import did_you_mean
from uav_bt.tree.script.values import ScriptError, Value, assigned
from uav_bt.tree.variables import Variables


class Environment:
    """The names of a script.

    Args:
        variables: the tree's variables.
        board: the mission board, for names that begin with `@`.
        enums: named integers; they come before variables of the same name.
    """

    def __init__(
        self,
        variables: Variables,
        board: Blackboard | None = None,
        enums: Mapping[str, int] | None = None,
    ) -> None:
        self._variables = variables
        self._board = board
        self._enums = dict(enums or {})

    def read(self, name: str) -> Value:
        """Return what a name stands for.

        Raises:
            ScriptError: nothing, nothing fresh, or nothing that a script can use.
        """
        if name in self._enums:
            return float(self._enums[name])
        key = self._board_key(name)
        value = self._variables.get(name) if key is None else self._read_board(key)
        if value is None:
            hint = did_you_mean(name, [*self._variables, *self._enums])
            raise ScriptError(f"'{name}' has no value{hint}")
        if not isinstance(value, (int, float, str)):
            kind = type(value).__name__
            raise ScriptError(f"'{name}' is a {kind}; scripts know numbers and texts")
        return value

    def holds(self, name: str) -> bool:
        """Return whether a variable exists."""
        return name in self._variables or self._board_key(name) is not None

    def write(self, name: str, value: Value) -> Any:
        """Write a variable in the type it has, and return what it holds now.

        Args:
            name: the variable.
            value: a number or a text.

        Raises:
            ScriptError: the value has another type, or the name is a board key.
        """
        key = self._board_key(name)
        if key is not None:
            what = f"'{name}' is a board key" if name == f"@{key}" else f"'{name}' is '@{key}'"
            raise ScriptError(f"{what}; leaves write those, scripts only read")
        try:
            self._variables[name] = kept = assigned(self._variables.get(name), value)
        except ScriptError as error:
            raise ScriptError(f"'{name}': {error}") from error
        return kept

    def _board_key(self, name: str) -> str | None:
        return name[1:] if name.startswith("@") else self._variables.board_key(name)

    def _read_board(self, key: str) -> Any:
        if self._board is None:
            raise ScriptError(f"'@{key}': there is no mission board here")
        return self._board.read(self._board.key(key)).value
