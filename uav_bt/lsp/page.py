"""One version of a tree file in an editor: text, markup and positions."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Final

from lsprotocol import types

from uav_bt.tree.editing.markup import Attribute, Branch, Kind, Piece, branches, scan
from uav_bt.tree.loading.elements import KIND_TAGS
from uav_bt.tree.loading.source import MAX_BYTES
from uav_bt.tree.node import NodeKind

_LINE_END: Final = re.compile(r"\r\n|\r|\n")
_TAGS: Final = frozenset({Kind.START, Kind.EMPTY})


class Page:
    """One version of a document.

    Args:
        text: the whole text. A text that is larger than the loader takes has no markup.
        path: what findings call the file.
        units: returns the length of a text in the client's units, by default UTF-16 code units.
        uri: the client's URI of the file; default: the path's URI.
    """

    def __init__(
        self, text: str, path: Path, units: Callable[[str], int] = len, uri: str = ""
    ) -> None:
        self.text = text
        self.path = path
        self.uri = uri or path.absolute().as_uri()
        self._units = units
        self._starts = [0, *(match.end() for match in _LINE_END.finditer(text))]

    @cached_property
    def pieces(self) -> list[Piece]:
        """The markup; a tag may be unfinished."""
        return list(scan(self.text, typed=True)) if len(self.text) <= MAX_BYTES else []

    @cached_property
    def roots(self) -> list[Branch]:
        """The outermost elements: one, unless somebody is typing."""
        return branches(self.pieces)

    @cached_property
    def _piece_starts(self) -> list[int]:
        return [piece.start for piece in self.pieces]

    def walk(self) -> Iterator[Branch]:
        """Iterate over all elements in the order of the text."""
        for root in self.roots:
            yield from root.walk()

    def trees(self) -> Iterator[tuple[str, Branch]]:
        """Iterate over the trees, by ID."""
        for root in self.roots:
            for child in root.children:
                if child.tag.name == "BehaviorTree":
                    yield child.text("ID"), child

    # --- places -----------------------------------------------------------------------------------

    def offset(self, position: types.Position) -> int:
        """Return the offset of a client's position; one beyond the text is at its end."""
        if position.line >= len(self._starts):
            return len(self.text)
        start: int = self._starts[position.line]
        last = position.line + 1 == len(self._starts)
        line = self.text[start : None if last else self._starts[position.line + 1]].rstrip("\r\n")
        wanted: int = position.character
        if self._units(line) == len(line):
            return start + min(wanted, len(line))
        at, passed = 0, 0
        while at < len(line) and passed < wanted:
            passed += self._units(line[at])
            at += 1
        return start + at

    def position(self, offset: int) -> types.Position:
        """Return an offset as the client counts."""
        line = bisect_right(self._starts, offset) - 1
        return types.Position(line, self._units(self.text[self._starts[line] : offset]))

    def range(self, start: int, end: int) -> types.Range:
        """Return a part of the text as the client counts."""
        return types.Range(self.position(start), self.position(end))

    def part(self, range_: types.Range) -> tuple[int, int]:
        """Return the offsets of a client's range."""
        return self.offset(range_.start), self.offset(range_.end)

    def place(self, line: int, column: int) -> int:
        """Return the offset of a finding's place, which counts from 1."""
        if not 0 < line <= len(self._starts):
            return 0
        return min(self._starts[line - 1] + column - 1, len(self.text))

    def edits_to(self, text: str) -> list[types.TextEdit]:
        """Return the edit that makes this page a text, without the lines that stay at both ends."""
        old, new = self.text.splitlines(keepends=True), text.splitlines(keepends=True)
        head = 0
        while head < min(len(old), len(new)) and old[head] == new[head]:
            head += 1
        tail = 0
        while tail < min(len(old), len(new)) - head and old[-1 - tail] == new[-1 - tail]:
            tail += 1
        if head == len(old) == len(new):
            return []
        start = sum(map(len, old[:head]))
        end = len(self.text) - sum(map(len, old[len(old) - tail :]))
        return [types.TextEdit(self.range(start, end), "".join(new[head : len(new) - tail]))]

    # --- markup -----------------------------------------------------------------------------------

    def piece_at(self, offset: int) -> Piece | None:
        """Return the piece that a cursor before this offset's character is in, or stands behind."""
        index = bisect_right(self._piece_starts, max(0, offset - 1)) - 1
        return self.pieces[index] if index >= 0 else None

    def before(self, piece: Piece) -> Piece | None:
        """Return the piece ahead of another."""
        index = bisect_right(self._piece_starts, piece.start) - 2
        return self.pieces[index] if index >= 0 else None

    def tag_from(self, offset: int) -> Piece | None:
        """Return the tag that contains an offset; a cursor behind it is outside."""
        index = bisect_right(self._piece_starts, offset) - 1
        piece = self.pieces[index] if index >= 0 else None
        return piece if piece is not None and piece.kind in {*_TAGS, Kind.END} else None

    @cached_property
    def by_tag(self) -> dict[int, Branch]:
        """The elements by the offset of their tag."""
        return {branch.tag.start: branch for branch in self.walk()}

    def around(self, offset: int) -> Branch | None:
        """Return the innermost element whose content an offset is in."""
        inside: Branch | None = None
        candidates = self.roots
        while True:
            found = next(
                (
                    one
                    for one in candidates
                    if one.tag.kind is Kind.START and one.tag.end <= offset < one.end
                ),
                None,
            )
            if found is None:
                return self._open_at_end(offset) if inside is None else inside
            inside, candidates = found, found.children

    def _open_at_end(self, offset: int) -> Branch | None:
        # At the very end of a text whose elements are still open.
        found = [b for b in self.walk() if b.tag.kind is Kind.START and b.end == offset]
        closed = self.pieces and self.pieces[-1].kind is Kind.END
        return found[-1] if found and not closed else None


def node_id_of(branch: Branch) -> str:
    """Return the id of the node that an element is; see `loading.source.node_id_of`."""
    tag = branch.tag.name
    return branch.text("ID") if tag in KIND_TAGS and tag != NodeKind.SUBTREE.value else tag


def tree_of(branch: Branch) -> Branch | None:
    """Return the tree that an element stands in, or is."""
    found: Branch | None = branch
    while found is not None and found.tag.name != "BehaviorTree":
        found = found.parent
    return found


def attribute_at(tag: Piece, offset: int) -> Attribute | None:
    """Return the attribute of a tag that an offset is in; its end counts, too."""
    return next((one for one in tag.attributes if one.start <= offset <= one.end), None)
