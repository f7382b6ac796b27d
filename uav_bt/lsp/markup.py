"""Tags and attributes of a text that may be unfinished XML."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

# A quote that is still open does not reach over the beginning of the next tag.
_QUOTED: Final = r"""(?:"[^"<]*+(?:<(?![\w/!])[^"<]*+)*+"|'[^'<]*+(?:<(?![\w/!])[^'<]*+)*+')"""
_MARKUP: Final = re.compile(
    r"<!--.*?(?:-->|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)|<[?!][^>]*+>?"
    r"|<(?P<slash>/?)(?P<name>[^\s<>/=\"'!?]*+)"
    rf"(?P<rest>(?:{_QUOTED}|[^<>/]|/(?!>))*+)(?P<closing>/?>)?",
    re.DOTALL,
)
_ATTRIBUTE: Final = re.compile(
    r"(?P<name>[^\s=<>/\"']++)(?:\s*+=\s*+(?P<quote>[\"'])(?P<value>.*?)(?:(?P=quote)|\Z))?",
    re.DOTALL,
)


class Attribute(NamedTuple):
    """An attribute of a tag; places are offsets in the text."""

    name: str
    value: str  # between the quotes, entities unresolved
    start: int
    name_end: int
    value_start: int  # -1: it has no value yet
    value_end: int


class Tag(NamedTuple):
    """A tag, which may be unfinished."""

    name: str
    attributes: tuple[Attribute, ...]
    start: int
    name_end: int
    end: int
    is_end: bool  # `</A>`
    closing: str  # its last characters: `>`, `/>`, or nothing yet

    def value(self, name: str) -> str:
        """Return the value of an attribute; empty without the attribute."""
        return next((one.value for one in self.attributes if one.name == name), "")

    def attribute_at(self, offset: int) -> Attribute | None:
        """Return the attribute that a cursor is in, or stands behind."""
        reached = (one for one in self.attributes if offset <= max(one.name_end, one.value_end))
        return next((one for one in reached if one.start < offset), None)


def tags(text: str) -> Iterator[Tag]:
    """Iterate over all tags; comments are passed over."""
    for match in _MARKUP.finditer(text):
        if match["name"] is not None:
            attributes = tuple(
                Attribute(m["name"], m["value"] or "", m.start(), m.end("name"), *m.span("value"))
                for m in _ATTRIBUTE.finditer(text, *match.span("rest"))
            )
            places = match.start(), match.end("name"), match.end()
            is_end, closing = bool(match["slash"]), match["closing"] or ""
            yield Tag(match["name"], attributes, *places, is_end, closing)


def place(text: str, offset: int) -> tuple[Tag | None, list[str]]:
    """Return the tag that a cursor is in, and the names of the open elements around it."""
    opened: list[str] = []
    for tag in tags(text):
        if offset <= tag.start:
            break
        if offset < tag.end or (offset == tag.end and not tag.closing):
            return tag, opened
        if tag.is_end and tag.name in opened:
            while opened.pop() != tag.name:
                pass
        elif not tag.is_end and tag.closing == ">":
            opened.append(tag.name)
    return None, opened
