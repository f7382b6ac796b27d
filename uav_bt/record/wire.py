"""Reading the few fields we need out of Foxglove's protobuf messages.

`foxglove-sdk` writes them and cannot read them, and Python's protobuf comes in versions that other
packages pin; the wire format itself is a page (protobuf.dev, "Encoding").
"""

from __future__ import annotations

from typing import Final

from uav_bt.errors import InputError

__all__ = ["fields"]

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_FIXED_SIZES: Final = {_FIXED64: 8, _FIXED32: 4}
_LONGEST_VARINT: Final = 10  # bytes of 64 bits, seven at a time


def fields(message: bytes) -> dict[int, int | memoryview]:
    """Return a message's fields by number; of a repeated one the last.

    Texts, bytes and inner messages are views on the message; numbers are unsigned integers.

    Raises:
        InputError: it is no protobuf message.
    """
    found: dict[int, int | memoryview] = {}
    view, at = memoryview(message), 0
    while at < len(view):
        tag, at = _varint(view, at)
        number, kind = tag >> 3, tag & 7
        if kind == _VARINT:
            found[number], at = _varint(view, at)
            continue
        if kind == _BYTES:
            size, at = _varint(view, at)
        elif kind in _FIXED_SIZES:
            size = _FIXED_SIZES[kind]
        else:
            raise InputError(f"expected a protobuf message, got a field of wire type {kind}")
        content = view[at : at + size]
        if len(content) < size:
            raise InputError(f"a protobuf field of {size} bytes is cut after {len(content)}")
        found[number] = content if kind == _BYTES else int.from_bytes(content, "little")
        at += size
    return found


def _varint(view: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for place, byte in enumerate(view[at : at + _LONGEST_VARINT]):
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            return value, at + place + 1
    raise InputError("expected a protobuf message, got an unfinished number")
