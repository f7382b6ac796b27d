"""The one layout of tree files: `uav-bt tree format`, and formatting in editors.

One element a line, two blanks a level; a tag that is too long has one attribute a line, so that a
changed attribute is a changed line. Comments, order, entities and single blank lines stay.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from uav_bt.errors import TreeError
from uav_bt.tree.editing.markup import Attribute, Kind, Piece, scan
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding
from uav_bt.tree.loading.source import Element, parse_source

MAX_WIDTH: Final = 100  # columns of a tag on one line
_INDENT: Final = 2
_TAB: Final = 4  # columns of a tab ahead of a comment's lines
_BYTE_ORDER_MARK: Final = "\N{ZERO WIDTH NO-BREAK SPACE}"


def format_source(data: bytes, path: Path) -> bytes:
    """Return a tree file's bytes in the one layout.

    A file in this layout does not change. All line ends become those of the first line.

    Args:
        data: the file's bytes; whether its nodes are known does not matter.
        path: what messages call the file.

    Raises:
        TreeError: the file is not well-formed XML, or exceeds a limit of tree files.
    """
    before = parse_source(data, path)
    text = data.decode().removeprefix(_BYTE_ORDER_MARK)
    newline = "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    formatted = _Writer(plain).lay_out().replace("\n", newline).encode()
    if _content(before) != _content(parse_source(formatted, path)):
        message = "cannot be formatted without changing what it says; please report this file"
        raise TreeError(path, [Finding(str(path), WHOLE_FILE, message)])
    return formatted


def _content(root: Element) -> list[object]:
    """Return everything but the layout, flat."""
    found: list[object] = []
    waiting = [root]
    while waiting:
        element = waiting.pop()
        words = "".join(element.text.split())
        found.append((element.tag, list(element.attributes.items()), words, len(element.children)))
        waiting.extend(element.children)
    return found


class _Writer:
    def __init__(self, text: str) -> None:
        self._text = text
        self._pieces = list(scan(text))
        self._lines: list[str] = []
        self._level = 0
        self._breaks = 1  # line breaks since the last piece
        self._blank_may_follow = False

    def lay_out(self) -> str:
        at = 0
        while at < len(self._pieces):
            at += self._write(at)
        return "\n".join(self._lines) + "\n"

    def _write(self, at: int) -> int:
        """Write the piece at an index, and return how many pieces that were."""
        piece = self._pieces[at]
        content = self._text[piece.start : piece.end]
        if piece.kind is Kind.TEXT and not content.strip():
            self._breaks = content.count("\n")
            return 1
        taken = 1
        if piece.kind is Kind.TEXT:
            self._breaks = content[: len(content) - len(content.lstrip())].count("\n")
        if piece.kind is Kind.COMMENT:
            self._comment(piece, content)
        elif piece.kind is Kind.END:
            self._level -= 1
            self._blank_may_follow = False
            self._line(f"</{piece.name}>")
        elif piece.kind is Kind.START:
            taken = self._start(at)
        else:
            # An empty tag, an instruction, or text between tags.
            self._line(self._tag(piece, "/>") if piece.kind is Kind.EMPTY else content.strip())
        self._breaks = 0
        if piece.kind is Kind.TEXT:
            self._breaks = content[len(content.rstrip()) :].count("\n")
        self._blank_may_follow = not (piece.kind is Kind.START and taken == 1)
        return taken

    def _line(self, content: str) -> None:
        if self._breaks > 1 and self._blank_may_follow:
            self._lines.append("")
        self._lines.append(" " * (_INDENT * self._level) + content)

    def _start(self, at: int) -> int:
        piece, *after = self._pieces[at : at + 3]
        if after and after[0].kind is Kind.END:
            self._line(self._tag(piece, "/>"))
            return 2
        if len(after) == 2 and after[0].kind is Kind.TEXT and after[1].kind is Kind.END:
            words = self._text[after[0].start : after[0].end].strip()
            if words:
                self._line(f"{self._tag(piece, '>')}{words}</{piece.name}>")
            else:
                self._line(self._tag(piece, "/>"))
            return 3
        self._line(self._tag(piece, ">"))
        self._level += 1
        return 1

    def _tag(self, piece: Piece, end: str) -> str:
        parts = [_attribute(one) for one in piece.attributes]
        line = " ".join([f"<{piece.name}", *parts]) + end
        several = len(parts) > 1
        fits = _INDENT * self._level + len(line) <= MAX_WIDTH
        if not several or (fits and "\n" not in line):
            return line
        outer = "\n" + " " * (_INDENT * self._level)
        inner = outer + " " * _INDENT
        return f"<{piece.name}{inner}{inner.join(parts)}{outer}{end}"

    def _comment(self, piece: Piece, content: str) -> None:
        head = self._text.rfind("\n", 0, piece.start) + 1
        before = self._text[head : piece.start]
        if before.strip() and self._breaks == 0 and self._lines:
            self._lines[-1] += f" {_shifted(content, 0)}"  # it speaks of what stands before it
            return
        now = len(before.expandtabs(_TAB))
        shift = 0 if before.strip() else _INDENT * self._level - now
        self._line(_shifted(content, shift))


def _shifted(comment: str, columns: int) -> str:
    """Return a comment whose further lines are moved as its first one was."""
    first, *rest = comment.split("\n")
    lines = [first.rstrip()]
    for line in rest:
        words = line.strip()
        lead = len(line[: len(line) - len(line.lstrip())].expandtabs(_TAB))
        lines.append(" " * max(0, lead + columns) + words if words else "")
    return "\n".join(lines)


def _attribute(attribute: Attribute) -> str:
    quote = "'" if '"' in attribute.value else '"'
    return f"{attribute.name}={quote}{attribute.value}{quote}"
