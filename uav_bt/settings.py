"""Checks of settings: numbers by the types of their fields, and choices."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Final, TypeVar

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
