"""The values of a board as plain data of bounded size, for records and displays."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from itertools import islice
from typing import Any, Final

import numpy as np

_MAX_DEPTH: Final = 6  # of values inside values
_MAX_ITEMS: Final = 64  # of a list or a mapping
_MAX_CHARS: Final = 500  # of a text
_INT_BITS: Final = 63  # bits that message formats can hold with any sign
_MORE: Final = "..."
_SINGLE: Final = (str, bytes, bytearray)


def plain(value: object, depth: int = _MAX_DEPTH) -> Any:
    """Return a value as None, bool, int, float, str, list or dict.

    Images and other arrays become their type and shape. Long and deep values are cut and marked
    by `...`. Any other object becomes the name of its type.
    """
    if depth < 0:
        return _MORE
    if isinstance(value, Mapping):
        some = islice(value.items(), _MAX_ITEMS)
        told = {_cut(str(key)): plain(item, depth - 1) for key, item in some}
        more = {_MORE: f"{len(value)} in all"} if len(value) > _MAX_ITEMS else {}
        return told | more
    if isinstance(value, Sequence | AbstractSet) and not isinstance(value, _SINGLE):
        items = [plain(item, depth - 1) for item in islice(value, _MAX_ITEMS)]
        return [*items, _MORE] if len(value) > _MAX_ITEMS else items
    if is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in fields(value)]
        return {name: plain(getattr(value, name), depth - 1) for name in names}
    return _single(value)


def _single(value: Any) -> bool | float | str | None:
    if isinstance(value, np.integer | np.bool_):
        value = value.item()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, int):
        bits = value.bit_length()
        return int(value) if bits <= _INT_BITS else f"{bits}-bit integer"
    texts = (words(value) for kind, words in _WORDS.items() if isinstance(value, kind))
    return next(texts, _cut(type(value).__name__))


def _cut(text: str) -> str:
    # A lone surrogate cannot be encoded in UTF-8.
    text = text[: _MAX_CHARS + 1].encode(errors="replace").decode()
    return text if len(text) <= _MAX_CHARS else text[:_MAX_CHARS] + _MORE


_WORDS: Final[dict[Any, Callable[[Any], str]]] = {
    str: _cut,
    (bytes, bytearray): lambda value: f"{len(value)} bytes",
    np.ndarray: lambda value: f"{value.dtype} array {'x'.join(map(str, value.shape))}",
    enum.Enum: lambda value: str(value.name),
}
