"""Our frozen dataclasses as JSON and back, without losing a bit, and the JSON schema of each.

Numbers are written as Python does, in the shortest form that reads back as the same double. What
JSON has no number for is a text, as in protobuf's JSON: "Infinity", "-Infinity", "NaN".
"""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, Literal, TypeVar, Union, cast

import numpy as np

from uav_bt.errors import InputError

__all__ = ["decode", "dump", "encode", "finite", "json_schema"]

T = TypeVar("T")

_TYPE: Final = "type"  # distinguishes the members of a union
_ODD: Final = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}


@dataclass(frozen=True, kw_only=True)
class _Codec:
    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]
    schema: dict[str, Any]


def encode(value: object) -> Any:
    """Return a value of one of our dataclasses as plain JSON values."""
    return _codec(type(value)).encode(value)


def decode(kind: type[T], data: object) -> T:
    """Return the value that `encode` was given.

    Args:
        kind: its dataclass.
        data: the plain JSON values.

    Raises:
        InputError: they are not of that kind.
    """
    try:
        return cast("T", _codec(kind).decode(data))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"expected the fields of {kind.__name__}, got {data!s:.120} "
            f"({type(error).__name__}: {error})"
        ) from error


def json_schema(kind: type[Any]) -> bytes:
    """Return the JSON schema of a dataclass, as viewers want it."""
    return dump({"title": kind.__name__, **_codec(kind).schema})


def dump(plain: object) -> bytes:
    """Return plain values as compact JSON.

    Raises:
        ValueError: a number among them is not finite; `finite` sees to that.
    """
    return json.dumps(plain, separators=(",", ":"), allow_nan=False).encode()


def finite(plain: Any) -> Any:
    """Return plain values with texts for the numbers that JSON does not have."""
    if isinstance(plain, float):
        return _encode_float(plain)
    if isinstance(plain, dict):
        return {name: finite(value) for name, value in plain.items()}
    if isinstance(plain, list):
        return [finite(value) for value in plain]
    return plain


def _encode_float(value: float) -> float | str:
    if math.isfinite(value):
        return float(value)
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _decode_float(data: float | str) -> float:
    return _ODD[data] if isinstance(data, str) else float(data)


_FLOAT: Final = _Codec(
    encode=_encode_float,
    decode=_decode_float,
    schema={"anyOf": [{"type": "number"}, {"enum": list(_ODD)}]},
)
_NONE: Final = _Codec(encode=lambda _: None, decode=lambda _: None, schema={"type": "null"})


def _same(kind: type[Any], name: str) -> _Codec:
    def check(data: Any) -> Any:
        if not isinstance(data, kind) or (kind is int and isinstance(data, bool)):
            raise TypeError(f"{data!r} is no {name}")
        return data

    return _Codec(encode=kind, decode=check, schema={"type": name})


_SIMPLE: Final = {
    float: _FLOAT,
    type(None): _NONE,
    bool: _same(bool, "boolean"),
    int: _same(int, "integer"),
    str: _same(str, "string"),
}


def _codec(hint: Any) -> _Codec:
    return _SIMPLE[hint] if hint in _SIMPLE else _made(hint)


@lru_cache(maxsize=256)
def _made(hint: Any) -> _Codec:
    origin = typing.get_origin(hint)
    if origin in (Union, types.UnionType):
        return _union(typing.get_args(hint))
    if origin is Literal:
        names = list(typing.get_args(hint))
        return _Codec(encode=str, decode=lambda data: data, schema={"enum": names})
    if origin is tuple:
        return _sequence(typing.get_args(hint)[0])
    if origin is np.ndarray:
        return _array(np.dtype(typing.get_args(typing.get_args(hint)[1])[0]))
    if isinstance(hint, enum.EnumType):
        return _enumeration(hint)
    if dataclasses.is_dataclass(hint):
        return _fields(cast("type[Any]", hint))
    raise TypeError(f"a record has no form for {hint!r}")


def _enumeration(kind: Any) -> _Codec:
    return _Codec(
        encode=lambda member: member.value,
        decode=kind,
        schema={"enum": [member.value for member in kind]},
    )


def _fields(kind: type[Any]) -> _Codec:
    hints = typing.get_type_hints(kind)
    codecs = {field.name: _codec(hints[field.name]) for field in dataclasses.fields(kind)}
    writers = [(name, codec.encode) for name, codec in codecs.items()]

    def write(value: Any) -> dict[str, Any]:
        return {name: encoder(getattr(value, name)) for name, encoder in writers}

    def read(data: Any) -> Any:
        # A field that a record of an older version lacks keeps its default.
        return kind(**{n: codec.decode(data[n]) for n, codec in codecs.items() if n in data})

    properties = {name: codec.schema for name, codec in codecs.items()}
    return _Codec(encode=write, decode=read, schema={"type": "object", "properties": properties})


def _union(members: tuple[Any, ...]) -> _Codec:
    inner = {member: _codec(member) for member in members}
    by_name = {getattr(member, "__name__", str(member)): member for member in members}
    tagged = sum(dataclasses.is_dataclass(member) for member in members) > 1

    def write(value: Any) -> Any:
        if value is None:
            return None
        if tagged:
            return {_TYPE: type(value).__name__, **inner[type(value)].encode(value)}
        return next(c.encode for m, c in inner.items() if m is not type(None))(value)

    def read(data: Any) -> Any:
        if data is None and type(None) in inner:
            return None
        if tagged:
            return inner[by_name[data[_TYPE]]].decode(data)
        return next(c.decode for m, c in inner.items() if m is not type(None))(data)

    if not tagged:
        return _Codec(
            encode=write, decode=read, schema={"anyOf": [c.schema for c in inner.values()]}
        )
    # Of movements a viewer plots any field; which fields belong together is the type's business.
    merged: dict[str, Any] = {
        _TYPE: {"enum": [n for n, m in by_name.items() if m is not type(None)]}
    }
    for codec in inner.values():
        merged.update(codec.schema.get("properties", {}))
    return _Codec(encode=write, decode=read, schema={"type": "object", "properties": merged})


def _sequence(item: Any) -> _Codec:
    codec = _codec(item)
    return _Codec(
        encode=lambda values: [codec.encode(value) for value in values],
        decode=lambda data: tuple(codec.decode(value) for value in data),
        schema={"type": "array", "items": codec.schema},
    )


def _array(dtype: np.dtype[Any]) -> _Codec:
    """Arrays keep their shape beside their values: an empty one has one, too."""

    def write(array: Any) -> dict[str, Any]:
        return {"shape": list(array.shape), "values": [_encode_float(x) for x in array.flat]}

    def read(data: Any) -> Any:
        values = np.array([_decode_float(x) for x in data["values"]], dtype=dtype)
        return values.reshape(data["shape"])

    numbers = {"type": "array", "items": _FLOAT.schema}
    shape = {"type": "array", "items": {"type": "integer"}}
    return _Codec(
        encode=write,
        decode=read,
        schema={"type": "object", "properties": {"shape": shape, "values": numbers}},
    )
