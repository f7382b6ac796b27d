"""The values of a board as plain data of bounded size, for records and displays."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import singledispatch
from itertools import islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_MAX_DEPTH: Final = 6  # of values inside values
_MAX_ITEMS: Final = 64  # of a list or a mapping
_MAX_CHARS: Final = 500  # of a text
_INT_BITS: Final = 63  # bits that message formats can hold with any sign
_MORE: Final = "..."


def plain(value: object) -> Any:
    """Return a value as None, bool, int, float, str, list or dict.

    Images and other arrays become their type and shape. Long and deep values are cut and marked
    by `...`. Any other object becomes the name of its type.
    """
    return _plain(value, _MAX_DEPTH)


def _inner(value: object, depth: int) -> Any:
    return _plain(value, depth - 1) if depth > 0 else _MORE


@singledispatch
def _plain(value: object, depth: int) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _inner(getattr(value, name), depth) for name in names}
    return value.name if isinstance(value, enum.Enum) else _cut(type(value).__name__)


@_plain.register(type(None))
@_plain.register(bool)
@_plain.register(float)
def _(value: Any, _depth: int) -> Any:
    return value


@_plain.register
def _(value: int, _depth: int) -> Any:
    return int(value) if value.bit_length() <= _INT_BITS else f"{value.bit_length()}-bit integer"


@_plain.register
def _(value: str, _depth: int) -> str:
    return _cut(value)


@_plain.register(bytes)
@_plain.register(bytearray)
def _(value: bytes, _depth: int) -> str:
    return f"{len(value)} bytes"


@_plain.register(np.ndarray)
def _(value: NDArray[Any], _depth: int) -> str:
    return f"{value.dtype} array {'x'.join(str(size) for size in value.shape)}"


@_plain.register(np.integer)
@_plain.register(np.bool_)
def _(value: Any, _depth: int) -> Any:
    return value.item()


@_plain.register(np.floating)
def _(value: Any, _depth: int) -> float:
    return float(value)


@_plain.register(Mapping)
def _(value: Mapping[Any, Any], depth: int) -> dict[str, Any]:
    some = islice(value.items(), _MAX_ITEMS)
    result = {_cut(str(key)): _inner(item, depth) for key, item in some}
    if len(value) > _MAX_ITEMS:
        result[_MORE] = f"{len(value)} in all"
    return result


@_plain.register(Sequence)
@_plain.register(AbstractSet)
def _(value: Any, depth: int) -> list[Any]:
    items = [_inner(item, depth) for item in islice(value, _MAX_ITEMS)]
    return [*items, _MORE] if len(value) > _MAX_ITEMS else items


def _cut(text: str) -> str:
    # A lone surrogate cannot be encoded in UTF-8.
    text = text[: _MAX_CHARS + 1].encode(errors="replace").decode()
    return text if len(text) <= _MAX_CHARS else text[:_MAX_CHARS] + _MORE
