"""Minimal protobuf writer: tags, varints and fixed-size numbers.

Source: the encoding guide of protocol buffers (proto3). A field with the default value zero is
omitted, as by generators of proto3. A nested message is written even if empty, because its presence
is information.
"""

from __future__ import annotations

import struct
from typing import Final

from sim_bridge.loopback.codec import varint
from uav_bt.errors import ValueRangeError

_VARINT: Final = 0  # wire types
_FIXED64: Final = 1
_LENGTH_DELIMITED: Final = 2
_FIXED32: Final = 5
_BITS: Final = 64


def unsigned(number: int, value: int) -> bytes:
    """Return a field of type uint32, uint64, bool or enum.

    Args:
        number: number of the field.
        value: 0 to 2^64 - 1.

    Raises:
        ValueRangeError: the value does not fit 64 bits, unsigned.
    """
    if not 0 <= value < 1 << _BITS:
        raise ValueRangeError(f"field {number} is an unsigned number of 64 bits, got {value}")
    return _tag(number, _VARINT) + varint(value) if value else b""


def signed(number: int, value: int) -> bytes:
    """Return a field of type sint32 or sint64 (zigzag).

    Args:
        number: number of the field.
        value: -2^63 to 2^63 - 1.

    Raises:
        ValueRangeError: the value does not fit 64 bits, signed.
    """
    if not -(1 << _BITS - 1) <= value < 1 << _BITS - 1:
        raise ValueRangeError(f"field {number} is a signed number of 64 bits, got {value}")
    return unsigned(number, value << 1 if value >= 0 else (-value << 1) - 1)


def float32(number: int, value: float) -> bytes:
    """Return a field of type float.

    Args:
        number: number of the field.
        value: rounded to 32 bits.
    """
    return _tag(number, _FIXED32) + struct.pack("<f", value) if value else b""


def double(number: int, value: float) -> bytes:
    """Return a field of type double.

    Args:
        number: number of the field.
        value: its value.
    """
    return _tag(number, _FIXED64) + struct.pack("<d", value) if value else b""


def message(number: int, content: bytes) -> bytes:
    """Return a field that is a message, a string or bytes.

    Args:
        number: number of the field.
        content: the encoded message, or the bytes.
    """
    return _tag(number, _LENGTH_DELIMITED) + varint(len(content)) + content


def _tag(number: int, wire_type: int) -> bytes:
    return varint(number << 3 | wire_type)
