"""Message table of ARSDK, Parrot's protocol between a drone and its controller.

`messages.txt` lists numbers, names and types; `tools/arsdk_table.py` writes it.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Final

from uav_bt.errors import FileError, UnknownNameError

Number = tuple[int, int, int]  # project or feature, class, message


class Kind(enum.Enum):
    """Python type of an argument's value."""

    INTEGER = "integer"
    FLOAT = "float"
    TEXT = "text"
    BINARY = "binary"
    CHOICE = "choice"  # one of the values, by name
    BITS = "bits"  # a set of the values, by name


class Buffer(enum.Enum):
    """Delivery of a message."""

    ACK = "ack"
    NOACK = "noack"
    PRIO = "prio"


class Memory(enum.Enum):
    """Part of an event that is sent to clients that connect later."""

    STATE = "state"  # the latest value
    NOTE = "note"  # nothing
    LIST = "list"  # all values
    MAP = "map"  # the latest value of each key


@dataclass(frozen=True, kw_only=True, slots=True)
class Argument:
    """One argument of a message."""

    name: str
    kind: Kind
    layout: str = ""  # format of `struct`, little endian; empty for a variable length
    values: tuple[str, ...] = ()  # names of a choice from 0, or of bits from the lowest


@dataclass(frozen=True, kw_only=True, slots=True)
class MessageType:
    """One command or event."""

    number: Number
    name: str  # for example ardrone3.Piloting.TakeOff or gimbal.set_target
    event: bool  # True: from the drone; False: a command to the drone
    buffer: Buffer
    memory: Memory
    key: str | None  # argument that identifies an entry of a map
    arguments: tuple[Argument, ...]


_NUMBERS: Final = MappingProxyType(  # formats of `struct`
    dict(zip(["u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64"], "BbHhIiQq", strict=True))
)
_PLAIN: Final = MappingProxyType(
    {
        "float": (Kind.FLOAT, "f"),
        "double": (Kind.FLOAT, "d"),
        "string": (Kind.TEXT, ""),
        "binary": (Kind.BINARY, ""),
        **{name: (Kind.INTEGER, layout) for name, layout in _NUMBERS.items()},
    }
)


class MessageTable:
    """All messages, by name and by number."""

    def __init__(self, types: Iterator[MessageType]) -> None:
        self._by_name = {one.name: one for one in types}
        self._by_number = {one.number: one for one in self._by_name.values()}

    def __iter__(self) -> Iterator[MessageType]:
        return iter(self._by_name.values())

    def named(self, name: str) -> MessageType:
        """Return a message.

        Raises:
            UnknownNameError: the name is not in the table.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise UnknownNameError("ARSDK message", name, self._by_name) from None

    def numbered(self, number: Number) -> MessageType | None:
        """Return a message; None if the number is not in the table."""
        return self._by_number.get(number)


@cache
def message_table() -> MessageTable:
    """Return the shipped table.

    Raises:
        FileError: the table is damaged.
    """
    path = resources.files("sim_bridge.loopback") / "messages.txt"
    return MessageTable(_read(path.read_text(encoding="utf-8"), str(path)))


def _read(text: str, path: str) -> Iterator[MessageType]:
    enums: dict[str, tuple[str, ...]] = {}
    for line, content in enumerate(text.splitlines(), start=1):
        words = content.split()
        if not words or words[0] == "#":
            continue
        try:
            if words[0] == "enum":
                enums[words[1]] = tuple(words[2:])
            else:
                yield _message(words, enums)
        except (KeyError, ValueError) as error:
            raise FileError(path, f"no message is written like this: {error!r}", line) from error


def _message(words: list[str], enums: Mapping[str, tuple[str, ...]]) -> MessageType:
    number, direction, buffer, memory, name, *arguments = words
    project, of, message = (int(part) for part in number.split("."))
    kind, _, key = memory.partition("=")
    return MessageType(
        number=(project, of, message),
        name=name,
        event={"event": True, "command": False}[direction],
        buffer=Buffer(buffer),
        memory=Memory(kind),
        key=key or None,
        arguments=tuple(_argument(word, enums) for word in arguments),
    )


def _argument(word: str, enums: Mapping[str, tuple[str, ...]]) -> Argument:
    name, _, of = word.partition(":")
    kind, _, values = of.partition(":")
    if kind == "enum":
        return Argument(name=name, kind=Kind.CHOICE, layout="i", values=enums[values])
    if kind.startswith("bits-"):
        layout = _NUMBERS[kind.removeprefix("bits-")]
        return Argument(name=name, kind=Kind.BITS, layout=layout, values=enums[values])
    plain, layout = _PLAIN[kind]
    return Argument(name=name, kind=plain, layout=layout)
