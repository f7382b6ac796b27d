"""Raw `&` and `<` in attributes: no XML, but read by the engine's parser, and so by this loader."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from uav_bt.tree.loading.findings import Position

# Comments and the like are matched to be passed over; every quantifier is possessive.
_TAG: Final = re.compile(
    rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    rb"|<(?P<tag>[A-Za-z_:](?:[^\"'<>]++|\"[^\"]*+\"|'[^']*+')*+)>",
    re.DOTALL,
)
_VALUE: Final = re.compile(rb"\"[^\"]*+\"|'[^']*+'")
_RAW: Final = re.compile(rb"&(?!(?:[A-Za-z]+|#[0-9]+|#x[0-9A-Fa-f]+);)|<")
_ESCAPED: Final = {b"&": b"&amp;", b"<": b"&lt;"}


@dataclass(frozen=True)
class Escaped:
    """A document whose attributes are XML."""

    data: bytes
    raw: tuple[Position, ...]  # where the file has what was escaped
    added: dict[int, list[tuple[int, int]]]  # by line: columns, and how many more there are then

    def position(self, at: Position) -> Position:
        """Return where the file has what stands at a place of the escaped document."""
        added = sum(more for column, more in self.added.get(at.line, ()) if column < at.column)
        return Position(at.line, at.column - added)


def escape_raw(data: bytes) -> Escaped | None:
    """Return a document with its attributes escaped, or None when that changes nothing.

    Args:
        data: UTF-8 text.
    """
    places = [
        raw.start() + value.start() + tag.start("tag")
        for tag in _TAG.finditer(data)
        if tag["tag"] is not None
        for value in _VALUE.finditer(tag["tag"])
        for raw in _RAW.finditer(value[0])
    ]
    if not places:
        return None
    parts: list[bytes] = []
    raw: list[Position] = []
    added: dict[int, list[tuple[int, int]]] = {}
    done, line = 0, 1
    for place in places:
        passed, letter = data[done:place], data[place : place + 1]
        line += passed.count(b"\n")
        begin = data.rfind(b"\n", 0, place) + 1
        column = len(data[begin:place].decode(errors="replace")) + 1
        before = added.setdefault(line, [])
        raw.append(Position(line, column))
        before.append((column + sum(more for _, more in before), len(_ESCAPED[letter]) - 1))
        parts += [passed, _ESCAPED[letter]]
        done = place + 1
    return Escaped(b"".join([*parts, data[done:]]), tuple(raw), added)
