"""Our frozen dataclasses as JSON and back, without losing a bit, and the JSON schema of each.

Numbers are written in Python's shortest form that reads back as the same double. Non-finite numbers
are texts, as in protobuf's JSON: "Infinity", "-Infinity", "NaN".
"""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import types
import typing
from collections.abc import Callable
from functools import cache, partial
from typing import Any, Final, Literal, NamedTuple, TypeVar, cast

import numpy as np

from uav_bt.errors import InputError

T = TypeVar("T")

_MAX_INTEGER: Final = 2**63 - 1
_ODD: Final = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}
_NUMBER: Final = {"anyOf": [{"type": "number"}, {"enum": list(_ODD)}]}
_MISFITS: Final = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
_NAMES: Final = {bool: "boolean", int: "integer", str: "string"}


class _Codec(NamedTuple):
    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]
    schema: dict[str, Any]


def encode(value: object) -> Any:
    """Return a value of one of our dataclasses as plain JSON values."""
    return _codec(cast("Any", type(value))).encode(value)


def decode(kind: type[T], data: object) -> T:
    """Return the value of a dataclass from the output of `encode`; InputError if it is none."""
    try:
        return cast("T", _codec(cast("Any", kind)).decode(data))
    except (InputError, *_MISFITS) as error:
        raise InputError(
            f"expected the fields of {kind.__name__}, got {data!s:.120} "
            f"({type(error).__name__}: {error})"
        ) from error


def json_schema(kind: type[Any]) -> bytes:
    """Return the JSON schema of a dataclass, for viewers."""
    return dump({"title": kind.__name__, **_codec(cast("Any", kind)).schema})


def dump(plain: object) -> bytes:
    """Return plain values as compact JSON; ValueError for a number that is not finite."""
    return json.dumps(plain, separators=(",", ":"), allow_nan=False).encode()


def finite(plain: Any) -> Any:
    """Return plain values with texts for non-finite numbers."""
    if isinstance(plain, float):
        return _encode_float(plain)
    if isinstance(plain, dict):
        return {name: finite(value) for name, value in plain.items()}
    return [finite(value) for value in plain] if isinstance(plain, list) else plain


def _encode_float(value: float) -> float | str:
    if math.isfinite(value):
        return float(value)
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def decode_float(data: object) -> float:
    """Return a number from a number, or from the text of a non-finite one; else InputError."""
    if isinstance(data, str) and data in _ODD:
        return _ODD[data]
    if isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    raise InputError(f"expected a number, got {data!s:.40}")


@cache
def _codec(hint: Any) -> _Codec:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is float:
        made = _Codec(_encode_float, decode_float, _NUMBER)
    elif hint in _NAMES:  # calling the type makes a Python number of numpy's
        made = _Codec(hint, partial(_exact, hint), {"type": _NAMES[hint]})
    elif origin in (typing.Union, types.UnionType):
        made = _union(arguments)
    elif origin is Literal:
        made = _Codec(str, lambda data: data, {"enum": list(arguments)})
    elif origin is tuple:
        item = _codec(arguments[0])
        made = _Codec(
            lambda values: [item.encode(value) for value in values],
            lambda data: tuple(item.decode(value) for value in data),
            {"type": "array", "items": item.schema},
        )
    elif origin is np.ndarray:
        made = _array(np.dtype(typing.get_args(arguments[1])[0]))
    elif isinstance(hint, enum.EnumType):
        values = [member.value for member in cast("Any", hint)]
        made = _Codec(lambda member: member.value, hint, {"enum": values})
    elif dataclasses.is_dataclass(hint):
        made = _fields(cast("type[Any]", hint))
    else:
        raise TypeError(f"a record has no form for {hint!r}")
    return made


def _exact(kind: type[Any], data: Any) -> Any:
    if type(data) is not kind or (kind is int and abs(data) > _MAX_INTEGER):
        raise TypeError(f"{data!r:.40} is no {_NAMES[kind]} of at most 64 bits")
    return data


def _fields(kind: type[Any]) -> _Codec:
    hints = typing.get_type_hints(kind)
    codecs = {field.name: _codec(hints[field.name]) for field in dataclasses.fields(kind)}
    properties = {name: codec.schema for name, codec in codecs.items()}
    return _Codec(
        lambda value: {name: one.encode(getattr(value, name)) for name, one in codecs.items()},
        # A new field keeps the schema version; a record without it has the default.
        lambda data: kind(**{n: one.decode(data[n]) for n, one in codecs.items() if n in data}),
        {"type": "object", "properties": properties},
    )


def _union(members: tuple[Any, ...]) -> _Codec:
    inner = {one.__name__: _codec(one) for one in members if one is not type(None)}
    codec = _tagged(inner) if len(inner) > 1 else next(iter(inner.values()))
    if len(inner) == len(members):
        return codec
    return _Codec(
        lambda value: None if value is None else codec.encode(value),
        lambda data: None if data is None else codec.decode(data),
        codec.schema if len(inner) > 1 else {"anyOf": [codec.schema, {"type": "null"}]},
    )


def _tagged(inner: dict[str, _Codec]) -> _Codec:
    """Return the codec of a union of dataclasses, told apart by the name of the type."""
    # Viewers plot any field of a movement, so the schema lists the fields of all types.
    merged: dict[str, Any] = {"type": {"enum": list(inner)}}
    for codec in inner.values():
        merged.update(codec.schema["properties"])

    def write(value: Any) -> Any:
        name = type(value).__name__
        return {"type": name, **inner[name].encode(value)}

    return _Codec(
        write,
        lambda data: inner[data["type"]].decode(data),
        {"type": "object", "properties": merged},
    )


def _array(dtype: np.dtype[Any]) -> _Codec:
    """Return the codec of an array: its shape beside its values, so empty arrays keep it."""

    def read(data: Any) -> Any:
        values = np.array([decode_float(x) for x in data["values"]], dtype=dtype)
        return values.reshape(data["shape"])

    shape = {"type": "array", "items": {"type": "integer"}}
    properties = {"shape": shape, "values": {"type": "array", "items": _NUMBER}}
    return _Codec(
        lambda array: {"shape": list(array.shape), "values": [*map(_encode_float, array.flat)]},
        read,
        {"type": "object", "properties": properties},
    )
