"""Checks of settings: numbers by the types of their fields, and choices; their short text."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from numbers import Integral, Real
from typing import Any, Final, TypeVar

import numpy as np

from uav_bt.errors import UnknownNameError, ValueRangeError

Choice = TypeVar("Choice", bound=enum.Enum)

_KINDS: Final = {"int": (Integral, "whole number"), "float": (Real, "number")}
_NONE: Final[Mapping[str, float]] = {}


def check_numbers(
    settings: Any, least: Mapping[str, float] = _NONE, most: Mapping[str, float] = _NONE
) -> None:
    """Refuse numbers that are not finite or out of their range.

    Fields of the types int and float, or None, of a dataclass object are checked. A number without
    a least value must be positive.
    """
    for each in fields(settings):
        stated = str(each.type).removeprefix("Annotated[").partition(",")[0]
        name, optional, _ = stated.partition(" | None")
        value = getattr(settings, each.name)
        if name not in _KINDS or (optional and value is None):
            continue
        kind, words = _KINDS[name]
        low, high = least.get(each.name), most.get(each.name, math.inf)
        fits = isinstance(value, kind) and not isinstance(value, bool) and math.isfinite(value)
        if fits and (value > 0 if low is None else value >= low) and value <= high:
            continue
        expected = f"a positive {words}" if low is None else f"a {words} from {low:g}"
        upwards = "" if math.isinf(high) else f" up to {high:g}"
        raise ValueRangeError(f"{each.name} must be {expected}{upwards}, got {value!r:.80}")


def member(name: str, value: object, choices: type[Choice]) -> Choice:
    """Return a choice from its value or from itself; raise UnknownNameError for any other value."""
    try:
        return choices(value)
    except ValueError:
        known = [str(choice.value) for choice in choices]
        raise UnknownNameError(name, f"{value}", known) from None


def brief_repr(value: Any) -> str:
    """Return a dataclass object as the code that creates it, without default values.

    Arrays are shown by shape and type. It is for `__repr__ = brief_repr` in a class's body.
    """
    return f"{type(value).__qualname__}({', '.join(_given(value))})"


def _given(value: Any) -> Iterator[str]:
    for each in fields(value):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        here = getattr(value, each.name)
        if isinstance(here, np.ndarray):
            yield f"{each.name}=<{'x'.join(map(str, here.shape))} {here.dtype}>"
        elif default is MISSING or here != default:
            yield f"{each.name}={here!r}"
