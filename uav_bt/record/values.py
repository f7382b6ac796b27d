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
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal, TypeVar, cast

import numpy as np

from uav_bt.errors import InputError

T = TypeVar("T")

_TYPE: Final = "type"  # distinguishes the members of a union
_MAX_INTEGER: Final = 2**63 - 1
_ODD: Final = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}


@dataclass(frozen=True, kw_only=True)
class _Codec:
    encode: Callable[[Any], Any]
    decode: Callable[[Any], Any]
    schema: dict[str, Any]


def encode(value: object) -> Any:
    """Return a value of one of our dataclasses as plain JSON values."""
    kind: Any = type(value)
    return _codec(kind).encode(value)


def decode(kind: type[T], data: object) -> T:
    """Return the value from the output of `encode`.

    Args:
        kind: dataclass of the value.
        data: the plain JSON values.

    Raises:
        InputError: the data does not fit the dataclass.
    """
    try:
        return cast("T", _codec(cast("Any", kind)).decode(data))
    except (
        InputError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        ArithmeticError,
    ) as error:
        raise InputError(
            f"expected the fields of {kind.__name__}, got {data!s:.120} "
            f"({type(error).__name__}: {error})"
        ) from error


def json_schema(kind: type[Any]) -> bytes:
    """Return the JSON schema of a dataclass, for viewers."""
    return dump({"title": kind.__name__, **_codec(cast("Any", kind)).schema})


def dump(plain: object) -> bytes:
    """Return plain values as compact JSON.

    Raises:
        ValueError: a number is not finite; `finite` replaces such numbers.
    """
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
    """Return a number from a number, or from the text of a non-finite one.

    Raises:
        InputError: the data is neither.
    """
    if isinstance(data, str) and data in _ODD:
        return _ODD[data]
    if isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    raise InputError(f"expected a number, got {data!s:.40}")


# --- codecs, made once for each type --------------------------------------------------------------


_FLOAT: Final = _Codec(
    encode=_encode_float,
    decode=decode_float,
    schema={"anyOf": [{"type": "number"}, {"enum": list(_ODD)}]},
)
_NAMES: Final = {bool: "boolean", int: "integer", str: "string", type(None): "null"}


@cache
def _codec(hint: Any) -> _Codec:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is float:
        made = _FLOAT
    elif hint in _NAMES:
        made = _exact(hint)
    elif origin in (typing.Union, types.UnionType):
        made = _union(arguments)
    elif origin is Literal:
        made = _Codec(encode=str, decode=lambda data: data, schema={"enum": list(arguments)})
    elif origin is tuple:
        made = _sequence(_codec(arguments[0]))
    elif origin is np.ndarray:
        made = _array(np.dtype(typing.get_args(arguments[1])[0]))
    elif isinstance(hint, enum.EnumType):
        values = [member.value for member in cast("Any", hint)]
        made = _Codec(encode=lambda member: member.value, decode=hint, schema={"enum": values})
    elif dataclasses.is_dataclass(hint):
        made = _fields(cast("type[Any]", hint))
    else:
        raise TypeError(f"a record has no form for {hint!r}")
    return made


def _exact(kind: type[Any]) -> _Codec:
    def read(data: Any) -> Any:
        if type(data) is not kind:
            raise TypeError(f"{data!r:.40} is no {_NAMES[kind]}")
        if kind is int and abs(data) > _MAX_INTEGER:
            raise ValueError(f"{data!r:.40} has more than 64 bits")
        return data

    # Convert a numpy number to a Python number.
    write = (lambda _: None) if kind is type(None) else kind
    return _Codec(encode=write, decode=read, schema={"type": _NAMES[kind]})


def _fields(kind: type[Any]) -> _Codec:
    hints = typing.get_type_hints(kind)
    codecs = {field.name: _codec(hints[field.name]) for field in dataclasses.fields(kind)}
    writers = [(name, codec.encode) for name, codec in codecs.items()]

    def write(value: Any) -> dict[str, Any]:
        return {name: encoder(getattr(value, name)) for name, encoder in writers}

    def read(data: Any) -> Any:
        # A new field keeps the schema version; a record without it has the default.
        return kind(**{n: codec.decode(data[n]) for n, codec in codecs.items() if n in data})

    properties = {name: codec.schema for name, codec in codecs.items()}
    return _Codec(encode=write, decode=read, schema={"type": "object", "properties": properties})


def _union(members: tuple[Any, ...]) -> _Codec:
    inner = {member: _codec(member) for member in members if member is not type(None)}
    if len(inner) > 1:
        codec = _tagged({member.__name__: one for member, one in inner.items()})
    else:
        (codec,) = inner.values()
    if len(inner) == len(members):
        return codec
    return _Codec(
        encode=lambda value: None if value is None else codec.encode(value),
        decode=lambda data: None if data is None else codec.decode(data),
        schema=codec.schema if len(inner) > 1 else {"anyOf": [codec.schema, {"type": "null"}]},
    )


def _tagged(inner: dict[str, _Codec]) -> _Codec:
    """Return the codec of a union of dataclasses."""
    # Viewers plot any field of a movement, so the schema lists the fields of all types.
    merged: dict[str, Any] = {_TYPE: {"enum": list(inner)}}
    for codec in inner.values():
        merged.update(codec.schema["properties"])

    def write(value: Any) -> Any:
        name = type(value).__name__
        return {_TYPE: name, **inner[name].encode(value)}

    return _Codec(
        encode=write,
        decode=lambda data: inner[data[_TYPE]].decode(data),
        schema={"type": "object", "properties": merged},
    )


def _sequence(item: _Codec) -> _Codec:
    return _Codec(
        encode=lambda values: [item.encode(value) for value in values],
        decode=lambda data: tuple(item.decode(value) for value in data),
        schema={"type": "array", "items": item.schema},
    )


def _array(dtype: np.dtype[Any]) -> _Codec:
    """Return the codec of an array: its shape beside its values, so empty arrays keep it."""

    def write(array: Any) -> dict[str, Any]:
        return {"shape": list(array.shape), "values": [_encode_float(x) for x in array.flat]}

    def read(data: Any) -> Any:
        values = np.array([decode_float(x) for x in data["values"]], dtype=dtype)
        return values.reshape(data["shape"])

    numbers = {"type": "array", "items": _FLOAT.schema}
    shape = {"type": "array", "items": {"type": "integer"}}
    return _Codec(
        encode=write,
        decode=read,
        schema={"type": "object", "properties": {"shape": shape, "values": numbers}},
    )
