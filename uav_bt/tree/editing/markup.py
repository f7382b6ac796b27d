"""Reader of a tree file's markup for editing: offsets, comments and blanks, unfinished tags too.

The loader's reader (`loading/source.py`) cannot serve here: it refuses unfinished text, which a
person types most of the time, and drops the comments and quotes that the formatter keeps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple


class Kind(Enum):
    """Kinds of pieces of markup."""

    START = "start"
    EMPTY = "empty"  # `<A/>`
    END = "end"
    COMMENT = "comment"
    INSTRUCTION = "instruction"  # the XML declaration, too
    TEXT = "text"  # blanks, too


class Attribute(NamedTuple):
    """An attribute as it is written; all places are offsets in the text."""

    name: str
    value: str  # between the quotes, entities unresolved
    start: int  # of the name
    value_start: int  # behind the opening quote, or where it is missing
    end: int  # behind the closing quote
    whole: bool = True  # False: still being typed

    @property
    def value_end(self) -> int:
        """Where the value ends."""
        return self.value_start + len(self.value)


class Piece(NamedTuple):
    """A tag, a comment, an instruction or a text; pieces follow each other without gaps."""

    kind: Kind
    start: int
    end: int
    name: str = ""  # of a tag
    attributes: tuple[Attribute, ...] = ()
    whole: bool = True  # False: a tag that nothing closes


@dataclass(eq=False, slots=True)
class Branch:
    """An element with its place in the document."""

    tag: Piece
    parent: Branch | None
    children: list[Branch] = field(default_factory=list)
    end: int = 0  # behind the end tag, or behind the last thing inside

    def attribute(self, name: str) -> Attribute | None:
        """Return the attribute of that name, or None."""
        return next((one for one in self.tag.attributes if one.name == name), None)

    def text(self, name: str) -> str:
        """Return an attribute's value with its entities resolved; empty without the attribute."""
        found = self.attribute(name)
        return "" if found is None else resolve(found.value)[0]

    def walk(self) -> Iterator[Branch]:
        """Iterate over the element and everything below, in the order of the text."""
        waiting = [self]
        while waiting:
            branch = waiting.pop()
            yield branch
            waiting.extend(reversed(branch.children))


_OTHER: Final = re.compile(
    r"(?P<comment><!--.*?(?:-->|\Z))"
    r"|(?P<instruction><\?.*?(?:\?>|\Z)|<!(?!\[CDATA\[)[^>]*>?)"
    r"|(?P<text>(?:[^<]++|<!\[CDATA\[.*?(?:\]\]>|\Z))+)"
    r"|(?P<tag></?)",
    re.DOTALL,
)
_KINDS: Final = {kind.value: kind for kind in Kind}
_NAME: Final = re.compile(r"[^\s<>/=\"'!?]*")
_BLANK: Final = re.compile(r"\s*")
_CLOSE: Final = re.compile(r"\s*(/?)>")
_ATTRIBUTE: Final = re.compile(r"([^\s=<>/\"']+)(?:\s*=\s*)?")
_EXACT: Final = re.compile(r"\"[^\"]*\"|'[^']*'")
# While one types, a quote may be open: it does not reach over the beginning of the next tag.
_TYPED: Final = re.compile(r"\"(?:[^\"<]|<(?![\w/!]))*\"|'(?:[^'<]|<(?![\w/!]))*'")
# A complete attribute. Incomplete ones are read part by part.
_WHOLE: Final = r"\s*+([^\s=<>/\"']++)\s*+=\s*+({})"
_WHOLE_ATTRIBUTE: Final = {
    quoted: re.compile(_WHOLE.format(quoted.pattern)) for quoted in (_EXACT, _TYPED)
}
_OPEN_VALUE: Final = re.compile(r"[\"'][^\"'<>\n]*")


def scan(text: str, *, typed: bool = False) -> Iterator[Piece]:
    """Iterate over all pieces of a text.

    Args:
        text: of a tree file.
        typed: whether it may be unfinished. A quote that is still open then ends before the next
            tag, at the price that a `<` and a letter inside a value count as one.
    """
    at = 0
    while at < len(text):
        match = _OTHER.match(text, at)
        if match is None or match.lastgroup == "tag":
            piece = _tag(text, at, _TYPED if typed else _EXACT)
        else:
            piece = Piece(_KINDS[match.lastgroup or ""], at, match.end())
        yield piece
        at = piece.end


def _tag(text: str, start: int, quoted: re.Pattern[str]) -> Piece:
    closing = text.startswith("</", start)
    name = _NAME.match(text, start + (2 if closing else 1))
    at = start + 1 if name is None else name.end()
    attributes: list[Attribute] = []
    whole_attribute = _WHOLE_ATTRIBUTE[quoted]
    while True:
        whole = whole_attribute.match(text, at)
        if whole is not None:
            at = whole.end()
            place = whole.start(2) + 1
            attributes.append(Attribute(whole[1], whole[2][1:-1], whole.start(1), place, at))
            continue
        close = _CLOSE.match(text, at)
        if close is not None:
            kind = Kind.END if closing else Kind.EMPTY if close[1] else Kind.START
            return Piece(kind, start, close.end(), name[0] if name else "", tuple(attributes))
        blank = _BLANK.match(text, at)
        attribute = _attribute(text, blank.end() if blank else at, quoted)
        if attribute is None:
            kind = Kind.END if closing else Kind.START
            return Piece(kind, start, at, name[0] if name else "", tuple(attributes), whole=False)
        attributes.append(attribute)
        at = attribute.end


def _attribute(text: str, start: int, quoted: re.Pattern[str]) -> Attribute | None:
    head = _ATTRIBUTE.match(text, start)
    if head is None:
        return None
    value = quoted.match(text, head.end())
    if value is not None:
        return Attribute(head[1], value[0][1:-1], start, value.start() + 1, value.end())
    value = _OPEN_VALUE.match(text, head.end())
    if value is not None:
        return Attribute(head[1], value[0][1:], start, value.start() + 1, value.end(), whole=False)
    return Attribute(head[1], "", start, head.end(), head.end(), whole=False)


def branches(pieces: list[Piece]) -> list[Branch]:
    """Return the outermost elements of a text, those inside them in place.

    An end tag that nothing opened is passed over; one that closes an outer element closes those
    that are still open in it.

    Args:
        pieces: of the whole text.
    """
    found: list[Branch] = []
    opened: list[Branch] = []
    for piece in pieces:
        if piece.kind in (Kind.START, Kind.EMPTY) and piece.name:
            parent = opened[-1] if opened else None
            branch = Branch(piece, parent, end=piece.end)
            (found if parent is None else parent.children).append(branch)
            if piece.kind is Kind.START and piece.whole:
                opened.append(branch)
        elif piece.kind is Kind.END and any(one.tag.name == piece.name for one in opened):
            while True:
                branch = opened.pop()
                branch.end = piece.end if branch.tag.name == piece.name else piece.start
                if branch.tag.name == piece.name:
                    break
    for branch in opened:
        branch.end = pieces[-1].end
    return found


_ENTITY: Final = re.compile(r"&(#[0-9]{1,7}|#x[0-9A-Fa-f]{1,6}|lt|gt|amp|quot|apos);")
_NAMED: Final = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}


def resolve(value: str) -> tuple[str, list[int]]:
    """Return a value with its entities resolved, and where each character stood.

    Args:
        value: as it is written.

    Returns:
        The text, and for each of its characters (and for its end) the offset in the value.
    """
    if "&" not in value:
        return value, list(range(len(value) + 1))
    text: list[str] = []
    places: list[int] = []
    at = 0
    while at < len(value):
        match = _ENTITY.match(value, at)
        text.append(value[at] if match is None else _character(match[1]))
        places.append(at)
        at = at + 1 if match is None else match.end()
    return "".join(text), [*places, at]


def _character(entity: str) -> str:
    if entity in _NAMED:
        return _NAMED[entity]
    code = int(f"0{entity[1:]}", 16 if entity[1] == "x" else 10)
    return chr(code) if code <= 0x10FFFF else "\N{REPLACEMENT CHARACTER}"
