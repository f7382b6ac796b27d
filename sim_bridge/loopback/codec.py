"""Codec of ARSDK messages: project, class and number, then the arguments, little endian."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from sim_bridge.loopback.messages import Argument, Kind, MessageTable, MessageType
from uav_bt.errors import InputError, UavBtError, ValueRangeError

_HEADER: Final = struct.Struct("<BBH")
_LENGTH: Final = struct.Struct("<I")


class WireError(UavBtError):
    """Received bytes are not a valid message."""


@dataclass(frozen=True, kw_only=True)
class Received:
    """A received message with its arguments. Choices are names; bits are sets of names."""

    type: MessageType
    values: Mapping[str, Any]


def varint(value: int) -> bytes:
    """Return a number of any size as a varint: seven bits per byte, the lowest first."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def encode(message: MessageType, values: Mapping[str, Any]) -> bytes:
    """Return the bytes of a message.

    Args:
        message: type of the message.
        values: all arguments, by name.

    Raises:
        InputError: an argument is missing or unknown.
        ValueRangeError: a value does not fit its type.
    """
    names = [argument.name for argument in message.arguments]
    if set(names) != set(values):
        raise InputError(f"{message.name} takes {sorted(names)}, got {sorted(values)}")
    project, of, number = message.number
    parts = [_HEADER.pack(project, of, number)]
    for argument in message.arguments:
        try:
            parts.append(_pack(argument, values[argument.name]))
        except (struct.error, ValueError, TypeError, OverflowError, AttributeError) as error:
            raise ValueRangeError(
                f"{message.name}: {argument.name} ({argument.kind.value}) cannot be "
                f"{values[argument.name]!r}: {error}"
            ) from error
    return b"".join(parts)


def _pack(argument: Argument, value: Any) -> bytes:
    layout = f"<{argument.layout}"
    if argument.kind is Kind.TEXT:
        data = value.encode()
        if b"\0" in data:
            raise ValueError("a text must not hold a NUL")
        return bytes(data) + b"\0"
    if argument.kind is Kind.BINARY:
        return _LENGTH.pack(len(value)) + bytes(value)
    if argument.kind is Kind.CHOICE:
        return struct.pack(layout, argument.values.index(value))
    if argument.kind is Kind.BITS:
        return struct.pack(layout, sum(1 << argument.values.index(name) for name in set(value)))
    return struct.pack(layout, value)


def decode(payload: bytes, table: MessageTable) -> Received:
    """Decode a message.

    Args:
        payload: exactly the bytes of the message.
        table: the known messages.

    Raises:
        WireError: the message is cut off or too long, holds an invalid value, or is not in the
            table.
    """
    if len(payload) < _HEADER.size:
        raise WireError(f"a message has at least {_HEADER.size} bytes, got {len(payload)}")
    number = _HEADER.unpack_from(payload)
    message = table.numbered(number)
    if message is None:
        raise WireError(f"no message is numbered {'-'.join(map(str, number))}")
    offset, values = _HEADER.size, {}
    for argument in message.arguments:
        try:
            values[argument.name], offset = _unpack(argument, payload, offset)
        except (struct.error, ValueError, IndexError) as error:
            raise WireError(f"{message.name}: {argument.name} is damaged: {error}") from error
    if offset != len(payload):
        raise WireError(f"{message.name} has {offset} bytes, got {len(payload)}")
    return Received(type=message, values=MappingProxyType(values))


def _unpack(argument: Argument, payload: bytes, offset: int) -> tuple[Any, int]:
    if argument.kind is Kind.TEXT:
        end = payload.index(b"\0", offset)
        return payload[offset:end].decode(), end + 1
    if argument.kind is Kind.BINARY:
        (size,) = _LENGTH.unpack_from(payload, offset)
        start, end = offset + _LENGTH.size, offset + _LENGTH.size + size
        if end > len(payload):
            raise ValueError(f"it announces {size} bytes")
        return payload[start:end], end
    layout = f"<{argument.layout}"
    (value,) = struct.unpack_from(layout, payload, offset)
    offset += struct.calcsize(layout)
    if argument.kind is Kind.CHOICE:
        if value < 0:
            raise ValueError(f"there is no value {value}")
        return argument.values[value], offset
    if argument.kind is Kind.BITS:
        # Clients of other versions may use bits that are not in the table.
        names = (name for bit, name in enumerate(argument.values) if value >> bit & 1)
        return frozenset(names), offset
    return value, offset
