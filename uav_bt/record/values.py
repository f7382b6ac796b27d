"""Our dataclasses as JSON and back, without losing a bit, and their JSON schemas.

Non-finite numbers are texts, as in protobuf's JSON: "Infinity", "-Infinity", "NaN".
"""

from __future__ import annotations

import enum
import json
import math
import types
import typing
from dataclasses import is_dataclass
from functools import cache
from typing import Any, Final, Literal, TypeVar

import numpy as np

from uav_bt.answers import Answer
from uav_bt.errors import InputError
from uav_bt.types import Movement

T = TypeVar("T")

_MAX_INTEGER: Final = 2**63 - 1
_ODD: Final = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}
_NUMBER: Final = {"anyOf": [{"type": "number"}, {"enum": list(_ODD)}]}
_MISFITS: Final = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError)
_NAMES: Final = {bool: "boolean", int: "integer", str: "string"}
_UNIONS: Final = (typing.Union, types.UnionType)
# Dataclasses that are told apart by the name of their type.
_TAGGED: Final = frozenset({*typing.get_args(Movement), *typing.get_args(Answer)})


def encode(value: Any, kind: Any = None) -> Any:
    """Return a value as plain JSON; of a dataclass the fields of `kind`, its type or a base."""
    plain = value.item() if isinstance(value, np.generic) else value
    kind = kind or type(value)
    if isinstance(plain, float) and not math.isfinite(plain):
        plain = "NaN" if math.isnan(plain) else "Infinity" if plain > 0 else "-Infinity"
    elif isinstance(plain, enum.Enum):
        plain = plain.value
    elif isinstance(plain, list | tuple):
        plain = [encode(each) for each in plain]
    elif isinstance(plain, dict):
        plain = {name: encode(each) for name, each in plain.items()}
    elif isinstance(plain, np.ndarray):  # with its shape, which empty arrays keep
        plain = {"shape": list(plain.shape), "values": encode(plain.ravel().tolist())}
    elif (known := _fields(kind)) is not None:
        plain = {"type": kind.__name__} if kind in _TAGGED else {}
        plain |= {name: encode(getattr(value, name)) for name in known}
    return plain


def decode(kind: type[T], data: object) -> T:
    """Return the value of a dataclass from the output of `encode`; InputError if it is none."""
    try:
        value: T = _decoded(kind, data)
    except (InputError, *_MISFITS) as error:
        raise InputError(
            f"expected the fields of {kind.__name__}, got {data!s:.120} "
            f"({type(error).__name__}: {error})"
        ) from error
    return value


def dump(plain: object) -> bytes:
    """Return plain values as compact JSON; ValueError for a number that is not finite."""
    return json.dumps(plain, separators=(",", ":"), allow_nan=False).encode()


def decode_float(data: object) -> float:
    """Return a number from a number, or from the text of a non-finite one; else InputError."""
    if isinstance(data, str) and data in _ODD:
        return _ODD[data]
    if isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    raise InputError(f"expected a number, got {data!s:.40}")


@cache
def _fields(kind: Any) -> dict[str, Any] | None:
    """Return the types of a dataclass's fields by name; None for any other type."""
    return typing.get_type_hints(kind) if is_dataclass(kind) else None


def _decoded(hint: Any, data: Any) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    value = data
    if hint is float:
        value = decode_float(data)
    elif (known := _fields(hint)) is not None:
        # A new field keeps the schema version; a record without it has the default.
        there = {name: kind for name, kind in known.items() if name in data}
        value = hint(**{name: _decoded(kind, data[name]) for name, kind in there.items()})
    elif origin is tuple:
        value = tuple(_decoded(arguments[0], each) for each in data)
    elif origin is np.ndarray:
        numbers = [decode_float(each) for each in data["values"]]
        value = np.array(numbers, dtype=typing.get_args(arguments[1])[0]).reshape(data["shape"])
    elif origin in _UNIONS:
        kinds = {each.__name__: each for each in arguments if each is not types.NoneType}
        if data is not None or len(kinds) == len(arguments):
            name = data["type"] if len(kinds) > 1 else next(iter(kinds))
            value = _decoded(kinds[name], data)
    elif isinstance(hint, enum.EnumType):
        value = hint(data)
    elif data not in arguments if origin is Literal else type(data) is not hint:
        raise TypeError(f"{data!r:.40} is no {hint}")
    elif hint is int and abs(data) > _MAX_INTEGER:
        raise TypeError(f"{data!r:.40} has more than 64 bits")
    return value


def json_schema(kind: type[Any]) -> bytes:
    """Return the JSON schema of a dataclass, for viewers."""
    return dump({"title": kind.__name__, **_schema(kind)})


def _schema(hint: Any) -> dict[str, Any]:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    schema: dict[str, Any] = {"type": _NAMES.get(hint, "object")}
    if hint is float:
        schema = _NUMBER
    elif (known := _fields(hint)) is not None:
        schema["properties"] = {name: _schema(kind) for name, kind in known.items()}
    elif origin is tuple:
        schema = {"type": "array", "items": _schema(arguments[0])}
    elif origin is np.ndarray:
        numbers = {"type": "array", "items": _NUMBER}
        schema["properties"] = {"shape": _schema(tuple[int, ...]), "values": numbers}
    elif origin in _UNIONS:
        inner = {each.__name__: _schema(each) for each in arguments if each is not types.NoneType}
        if len(inner) == 1:
            schema = {"anyOf": [*inner.values(), {"type": "null"}]}
        else:  # viewers plot any field of a movement: the fields of all types
            schema["properties"] = {"type": {"enum": list(inner)}}
            for one in inner.values():
                schema["properties"].update(one["properties"])
    elif origin is Literal or isinstance(hint, enum.EnumType):
        schema = {"enum": [*arguments] or [each.value for each in hint]}
    return schema
