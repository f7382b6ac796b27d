"""Checks of the options of a landing mark."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.types import LandingMark


def refuse_unknown(
    mark: LandingMark, known: Iterable[str], given: Mapping[str, Any] | None = None
) -> None:
    """Refuse options that a kind of landing mark does not have.

    Args:
        mark: The landing mark.
        known: Names of the options.
        given: The options to check. Default: those of the mark.

    Raises:
        ValueRangeError: An option is unknown; the message suggests the closest one.
    """
    known = tuple(known)
    for name in mark.options if given is None else given:
        if name not in known:
            hint = did_you_mean(str(name), known)
            raise ValueRangeError(
                f"landing mark '{mark.kind}' has no option '{name}'{hint} "
                f"(options: {', '.join(known) if known else 'none'})"
            )


def whole_number(name: str, value: object) -> int:
    """Return an option that must be a whole number from 0.

    Raises:
        ValueRangeError: It is another value.
    """
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueRangeError(f"option {name}: expected a whole number from 0, got {value!r}")
    return value


def metres(name: str, value: object, *, signed: bool = False) -> float:
    """Return an option that must be a length in metres.

    Args:
        name: Name of the option.
        value: Its value.
        signed: Whether 0 and negative values are allowed.

    Raises:
        ValueRangeError: It is another value.
    """
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or (value <= 0.0 and not signed):  # type: ignore[arg-type, operator]
        expected = "a number of metres" if signed else "a positive number of metres"
        raise ValueRangeError(f"option {name}: expected {expected}, got {value!r}")
    return float(value)  # type: ignore[arg-type]
