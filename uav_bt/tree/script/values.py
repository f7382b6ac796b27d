"""Values of scripts: numbers and texts, and what becomes of them when they meet.

As in BehaviorTree.CPP: arithmetic gives reals, comparisons give 1 or 0, a variable keeps the type
it began with.
"""

from __future__ import annotations

import math
from typing import Any, Final

Value = int | float | str

MAX_TEXT: Final = 100_000  # characters; `s += s` at every tick would fill the memory
_EPSILON: Final = 2.0**-23  # reals closer than this are equal: the engine's, of a C float
_WORDS: Final = {"true": 1.0, "false": 0.0}


class ScriptError(ValueError):
    """A script cannot be read, or fails when it runs."""


def number(value: object) -> float:
    """Return a value as a real; a text must be a number, `true` or `false`.

    Raises:
        ScriptError: it is none.
    """
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, str):
        if value in _WORDS:
            return _WORDS[value]
        try:
            real = float(value)
        except ValueError:
            real = math.nan
        if math.isfinite(real):
            return real
    raise ScriptError(f"expected a number, got {_words(value)}")


def truth(value: object) -> bool:
    """Return a value as true or false.

    Raises:
        ScriptError: it is neither: only 1 and 0 are.
    """
    real = number(value)
    if real not in {0.0, 1.0}:
        raise ScriptError(f"expected true or false (1 or 0), got {value}; write a comparison")
    return real == 1.0


def compare_equal(left: float, right: float) -> bool:
    """Return whether two reals count as equal."""
    return left == right or abs(left - right) <= _EPSILON


def assigned(old: Any, new: Value) -> Any:
    """Return a new value in the type that the variable has.

    Args:
        old: what the variable holds; None when it does not exist yet.
        new: what it is to hold.

    Raises:
        ScriptError: the value does not fit.
    """
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
