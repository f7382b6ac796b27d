"""Messages of ARSDK, Parrot's protocol between a drone and its controller.

`messages.txt` lists their numbers, names and types; `tools/arsdk_table.py` writes it. An encoded
message is its number (project, class, message) and its arguments, little endian. Messages with
arguments of type binary, which only plug-ins of a drone use, are not decoded.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final

from uav_bt.errors import UavBtError

Values = Mapping[str, Any]  # arguments of a message, by name
Number = tuple[int, int, int]  # project or feature, class, message

_NUMBER: Final = struct.Struct("<BBH")
_KINDS: Final = ("u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "float", "double", "enum")
_FORMATS: Final = dict(zip(_KINDS, "BbHhIiQqfdi", strict=True))  # of `struct`


class WireError(UavBtError):
    """Received bytes are not a valid message."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Argument:
    """One argument of a message."""

    name: str
    kind: str  # a number's type, string, enum (one of `names`) or bits (a set of them)
    layout: str = ""  # format of `struct`, little endian; empty for a string
    names: tuple[str, ...] = ()  # of an enum from 0, or of bits from the lowest

    def pack(self, value: Any) -> bytes:
        """Return the bytes of a value."""
        if self.kind == "string":
            return bytes(value.encode()) + b"\0"
        if self.kind == "enum":
            value = self.names.index(value)
        elif self.kind == "bits":
            value = sum(1 << self.names.index(name) for name in set(value))
        return struct.pack(f"<{self.layout}", value)

    def unpack(self, payload: bytes, offset: int) -> tuple[Any, int]:
        """Return the value at an offset of a message, and the offset of its end."""
        if self.kind == "string":
            end = payload.index(b"\0", offset)
            return payload[offset:end].decode(), end + 1
        (value,) = struct.unpack_from(f"<{self.layout}", payload, offset)
        if self.kind == "enum":
            value = dict(enumerate(self.names))[value]
        elif self.kind == "bits":
            # Clients of other versions may use bits that have no name here.
            value = {name for bit, name in enumerate(self.names) if value >> bit & 1}
        return value, offset + struct.calcsize(f"<{self.layout}")


@dataclass(frozen=True, kw_only=True, slots=True)
class MessageType:
    """One command or event."""

    number: Number
    name: str  # for example ardrone3.Piloting.TakeOff or gimbal.set_target
    event: bool  # True: from the drone; False: a command to the drone
    buffer: str  # delivery: ack, noack or prio
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, kw_only=True)
class Message:
    """A message with its arguments; an enum's value is a name, that of bits a set of names."""

    name: str
    values: Values


@cache
def message_types() -> Mapping[str, MessageType]:
    """Return the shipped messages by name."""
    path = resources.files("sim_bridge.loopback") / "messages.txt"
    return {one.name: one for one in _read(path.read_text(encoding="utf-8"))}


@cache
def _numbered() -> Mapping[Number, MessageType]:
    return {one.number: one for one in message_types().values()}


def encode(name: str, values: Values) -> bytes:
    """Return the bytes of a message with all its arguments."""
    message = message_types()[name]
    arguments = b"".join(one.pack(values[one.name]) for one in message.arguments)
    return _NUMBER.pack(*message.number) + arguments


def decode(payload: bytes) -> Message:
    """Return the message of exactly these bytes.

    Raises:
        WireError: the message is cut off, too long, damaged, or not in the table.
    """
    if len(payload) < _NUMBER.size:
        raise WireError(f"a message has at least {_NUMBER.size} bytes, got {len(payload)}")
    number = _NUMBER.unpack_from(payload)
    message = _numbered().get(number)
    if message is None:
        raise WireError(f"no message is numbered {'-'.join(map(str, number))}")
    offset, values = _NUMBER.size, {}
    for argument in message.arguments:
        try:
            values[argument.name], offset = argument.unpack(payload, offset)
        except (struct.error, ValueError, KeyError) as error:
            raise WireError(f"{message.name}: {argument.name} is damaged: {error}") from error
    if offset != len(payload):
        raise WireError(f"{message.name} has {offset} bytes, got {len(payload)}")
    return Message(name=message.name, values=values)


def varint(value: int) -> bytes:
    """Return a number of any size as a varint: seven bits per byte, the lowest first."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def _read(text: str) -> Iterator[MessageType]:
    enums: dict[str, tuple[str, ...]] = {}
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        first, *words = line.split()
        if first == "enum":
            enums[words[0]] = tuple(words[1:])
            continue
        direction, buffer, name, *arguments = words
        project, of, message = map(int, first.split("."))
        yield MessageType(
            number=(project, of, message),
            name=name,
            event=direction == "event",
            buffer=buffer,
            arguments=tuple(_argument(word, enums) for word in arguments),
        )


def _argument(word: str, enums: Mapping[str, tuple[str, ...]]) -> Argument:
    """Return the argument that is written `name:kind`, `name:enum:ENUM` or `name:bits-u8:ENUM`."""
    name, kind, *of = word.split(":")
    kind, _, integer = kind.partition("-")
    names = enums[of[0]] if of else ()
    return Argument(name=name, kind=kind, layout=_FORMATS.get(integer or kind, ""), names=names)
