"""Values of scripts: numbers and texts, their conversion, and the variables that hold them.

As in BehaviorTree.CPP, arithmetic gives reals, comparisons give 1 or 0, and a variable keeps the
type of its first value.
"""

from __future__ import annotations

import math
from typing import Any, Final

from uav_bt.board.blackboard import Blackboard
from uav_bt.errors import BoardAccessError, UnknownValueError, did_you_mean
from uav_bt.tree.variables import Variables

Value = int | float | str

ONLY_LEAVES_WRITE: Final = "leaves write those, scripts only read"  # of board keys, in messages
TRUTH_WORDS: Final = {"true": 1.0, "false": 0.0}
MAX_TEXT: Final = 100_000  # characters; limits scripts such as `s += s` at every tick
_EPSILON: Final = 2.0**-23  # reals closer than this are equal; the engine uses it, from C float
# The spellings that the format's engine reads as truth values, and `!` of a text takes.
_TRUTHS: Final = {
    **dict.fromkeys(("true", "True", "TRUE", "1"), True),
    **dict.fromkeys(("false", "False", "FALSE", "0"), False),
}


class ScriptError(ValueError):
    """A script cannot be parsed or fails when it runs."""


def number(value: object) -> float:
    """Return a value as a real; a text must be a number, `true` or `false`."""
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, str):
        try:
            real = TRUTH_WORDS[value] if value in TRUTH_WORDS else float(value)
        except ValueError:
            real = math.nan
        if math.isfinite(real):
            return real
    raise ScriptError(f"expected a number, got {_words(value)}")


def truth(value: object) -> bool:
    """Return a value as true or false: it must be 1, 0 or a text that spells a truth value."""
    if isinstance(value, str) and value in _TRUTHS:
        return _TRUTHS[value]
    real = number(value)
    if real not in {0.0, 1.0}:
        raise ScriptError(f"expected true or false (1 or 0), got {value}; write a comparison")
    return real == 1.0


def compare_equal(left: float, right: float) -> bool:
    """Return whether two reals count as equal."""
    return left == right or abs(left - right) <= _EPSILON


def assigned(old: Any, new: Value) -> Any:
    """Return a new value in the type of the variable's present value; None: it has none yet."""
    if old is None:
        return new
    if isinstance(old, str):
        if not isinstance(new, str):
            raise ScriptError(f"the variable holds a text, got {new}")
        return new
    if isinstance(old, bool):
        return truth(new)
    if isinstance(old, int):
        real = number(new)
        if not real.is_integer():
            raise ScriptError(f"the variable holds an integer, got {new}")
        return new if isinstance(new, int) else int(real)
    if isinstance(old, float):
        return number(new)
    raise ScriptError(f"the variable holds {_words(old)}, which scripts cannot change")


def _words(value: object) -> str:
    return f"'{value:.40}'" if isinstance(value, str) else type(value).__name__


class Environment:
    """The names of a script: the tree's variables, and with `@` the keys of the mission board."""

    def __init__(self, variables: Variables, board: Blackboard | None = None) -> None:
        self._variables = variables
        self._board = board

    def read(self, name: str) -> Value:
        """Return the value of a name; a board key without a fresh one raises UnknownValueError."""
        members = self._variables.enum_members
        if name in members:  # an enumeration comes before a variable, as in the engine
            return float(members[name])
        key = self._board_key(name)
        value = self._variables.get(name) if key is None else self._read_board(key)
        if value is None:
            hint = did_you_mean(name, [*self._variables, *members])
            raise ScriptError(f"'{name}' has no value{hint}")
        if not isinstance(value, (int, float, str)):
            kind = type(value).__name__
            raise ScriptError(f"'{name}' is a {kind}; scripts know numbers and texts")
        return value

    def known(self, name: str) -> bool:
        """Return whether a variable has a value, or a board key a fresh one."""
        key = self._board_key(name)
        if key is None:
            return self._variables.get(name) is not None
        try:
            self._read_board(key)
        except UnknownValueError:
            return False
        return True

    def number(self, value: Value) -> float:
        """Return a value as a real; a text may be the name of an enumeration's member."""
        members = self._variables.enum_members
        return float(members[value]) if value in members else number(value)

    def holds(self, name: str) -> bool:
        """Return whether a variable exists, or a board key of that name."""
        return name in self._variables or self._board_key(name) is not None

    def write(self, name: str, value: Value) -> Any:
        """Write a variable without changing its type, and return its new value."""
        key = self._board_key(name)
        if key is not None:
            what = f"'{name}' is a board key" if name == f"@{key}" else f"'{name}' is '@{key}'"
            raise ScriptError(f"{what}; {ONLY_LEAVES_WRITE}")
        old = self._variables.get(name)
        try:
            kept = assigned(old, value)
        except ScriptError as error:
            raise ScriptError(f"'{name}': {error}") from error
        self._variables[name] = kept
        return kept

    def _board_key(self, name: str) -> str | None:
        return name[1:] if name.startswith("@") else self._variables.board_key(name)

    def _read_board(self, key: str) -> Any:
        if self._board is None:
            raise ScriptError(f"'@{key}': this script runs without a mission, so it has no board")
        try:
            declared = self._board.key(key)
        except BoardAccessError as error:  # no leaf of the tree declares it
            raise UnknownValueError(str(error)) from error
        reading = self._board.read(declared)
        if reading.value is None:
            if math.isinf(reading.age_s):
                raise UnknownValueError(f"board key '{key}' has no value yet")
            age = f"age {reading.age_s:.2f} s"
            raise UnknownValueError(f"board key '{key}' has no fresh value ({age})")
        return reading.value
