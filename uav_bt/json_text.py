"""Parser of foreign JSON: plain values of bounded depth with finite numbers, or one error."""

from __future__ import annotations

import json
import math
from typing import Any, Final, NoReturn

from uav_bt.errors import InputError

_MAX_DEPTH: Final = 64  # ours has less than ten; `repr` and our walks recurse


def parse_json(text: bytes | str) -> Any:
    """Return the value of a JSON text (bytes are UTF-8); InputError for any other."""
    try:
        text = text.decode() if isinstance(text, bytes) else text
        value = _DECODER.decode(text)
        deep = text.count("[") + text.count("{") > _MAX_DEPTH and _depth(value) > _MAX_DEPTH
    except ValueError as error:  # also not UTF-8, or an integer of thousands of digits
        raise InputError(f"no JSON: {error}") from error
    except RecursionError:
        deep = True
    if deep:
        raise InputError(f"no JSON that can be read: nested deeper than {_MAX_DEPTH}")
    return value


def _depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value
    return 1 + max(map(_depth, inner), default=0) if isinstance(value, dict | list) else 0


def _finite(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        raise InputError(f"no JSON that can be read: {text:.40} is beyond a double's range")
    return value


def _refuse(name: str) -> NoReturn:
    raise InputError(f"{name} is not JSON")


_DECODER: Final = json.JSONDecoder(parse_float=_finite, parse_constant=_refuse)
