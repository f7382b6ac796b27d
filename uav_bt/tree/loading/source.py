"""Reader of tree files: XML without entities, with limits, and with the position of every part.

Expat gives line and column of every element. A document type declaration, which all entity attacks
need, is refused where it begins.
"""

from __future__ import annotations

import codecs
import contextlib
import re
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Final, TypeVar
from xml.parsers import expat

from uav_bt.errors import TreeError
from uav_bt.files import read_bounded
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position, Rule

_T = TypeVar("_T", bound=Hashable)
_E = TypeVar("_E")

MAX_BYTES: Final = 2_000_000  # a mission has some kilobytes
_SMALLER: Final = "SubTrees can stand in other files"
MAX_DEPTH: Final = 256  # levels; the engine's own limit
MAX_ELEMENTS: Final = 20_000
MAX_NODES: Final = 20_000  # of a tree; subtrees inside subtrees multiply
MAX_ATTRIBUTES: Final = 200  # of one element; nodes have less than ten
MAX_NAME: Final = 255  # characters of a tag or of an attribute's name
MAX_VALUE: Final = 20_000  # characters of an attribute; scripts have some dozens
_MAX_TEXT: Final = 1_000  # characters kept of a text between tags; it only serves messages

# Of what expat has accepted; nothing is tried twice, so that the time is linear in the length.
_TAG: Final = re.compile(rb"<[^\s/>]++")
_ATTRIBUTE: Final = re.compile(rb"\s++([^\s=]++)\s*+=\s*+(?:\"[^\"]*+\"|'[^']*+')")


@dataclass
class Element:
    """An XML element with its positions in the file."""

    path: Path  # of the file
    tag: str
    attributes: dict[str, str]
    position: Position
    # Finds where each attribute stands, for messages: few elements are asked.
    locate: Callable[[], dict[str, Position]] = field(repr=False, compare=False)
    children: list[Element] = field(default_factory=list)
    text: str = ""
    raw: tuple[Position, ...] = ()  # of a root: where attributes have a raw `&` or `<`

    @property
    def label(self) -> str:
        """How messages name the element."""
        name = self.attributes.get("name") or self.attributes.get("ID")
        return f"{self.tag} '{name}'" if name else self.tag

    @cached_property
    def attribute_positions(self) -> dict[str, Position]:
        """Where each attribute stands, by name."""
        return self.locate()

    def at(self, attribute: str) -> Position:
        """Return the position of an attribute; without that attribute, of the element."""
        return self.attribute_positions.get(attribute, self.position)


class _RefusedError(Exception):
    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message


class _Builder:
    def __init__(self, data: bytes, path: Path) -> None:
        self.root: Element | None = None
        self._path = path
        self._data = data
        self._open: list[Element] = []
        self._count = 0
        # Whatever the declaration says, as the format's own engine has it.
        self.parser = expat.ParserCreate("UTF-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype

    def here(self) -> Position:
        return Position(self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def _doctype(self, *_arguments: object) -> None:
        raise _RefusedError("document type declarations and entities are not allowed")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise _RefusedError(f"more than {MAX_ELEMENTS} elements")
        if len(self._open) >= MAX_DEPTH + 2:  # the nodes stand in <root> and <BehaviorTree>
            raise _RefusedError(f"nodes are nested deeper than {MAX_DEPTH}")
        if len(attributes) > MAX_ATTRIBUTES:
            raise _RefusedError(f"an element has more than {MAX_ATTRIBUTES} attributes")
        if max(len(tag), *map(len, attributes), 0) > MAX_NAME:
            raise _RefusedError(f"a name is longer than {MAX_NAME} characters")
        for name, text in attributes.items():
            if len(text) > MAX_VALUE:
                raise _RefusedError(f"attribute '{name}' is longer than {MAX_VALUE} characters")
        here = self.here()
        locate = partial(_locate, self._data, self.parser.CurrentByteIndex, here)
        element = Element(self._path, tag, attributes, here, locate)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        self._open.pop()

    def _text(self, text: str) -> None:
        element, words = self._open[-1], text.strip()
        if words and len(element.text) < _MAX_TEXT:
            element.text += words[:_MAX_TEXT]


def _locate(data: bytes, start: int, here: Position) -> dict[str, Position]:
    """Return where each attribute of a tag stands, by name.

    Args:
        data: the document.
        start: of the tag, in bytes.
        here: the tag's place.
    """
    line, column = here.line, here.column
    found: dict[str, Position] = {}
    done = start
    match = _TAG.match(data, done)
    while match is not None:
        match = _ATTRIBUTE.match(data, match.end())
        if match is None:
            break
        passed = data[done : match.start(1)]
        newlines = passed.count(b"\n")
        line += newlines
        column = len(passed.rpartition(b"\n")[2].decode(errors="replace")) + (
            1 if newlines else column
        )
        done = match.start(1)
        found[match[1].decode(errors="replace")] = Position(line, column)
    return found


def read_source(path: Path) -> bytes:
    """Return a tree file's bytes.

    Raises:
        TreeError: the file does not exist, cannot be read or is too large.
    """
    return read_bounded(path, MAX_BYTES, _refused, cure=_SMALLER)


def parse_source(data: bytes, path: Path) -> Element:
    """Return the root element of a document.

    Args:
        data: the file's bytes.
        path: what messages call the file.

    Raises:
        TreeError: the document is not well-formed XML, or exceeds a limit of tree files.
    """
    if len(data) > MAX_BYTES:
        raise _refused(path, f"larger than {MAX_BYTES} bytes: {_SMALLER}")
    _check_utf8(data, path)
    try:
        return _parsed(data, path)
    except expat.ExpatError as error:
        escaped = _escape_raw(data)
        if escaped is not None:
            with contextlib.suppress(expat.ExpatError):
                return _placed_back(_parsed(escaped.data, path), escaped)
        where = Position(error.lineno, error.offset + 1)
        reason = expat.errors.messages[error.code]
        begin = data.removeprefix(codecs.BOM_UTF8).strip()
        if begin and not begin.startswith(b"<"):
            line = begin.partition(b"\n")[0].decode()[:40].rstrip()
            reason = f"expected a tag such as <root>, got '{line}'"
        raise _refused(path, f"not well-formed XML: {reason}", where) from error


def _parsed(data: bytes, path: Path) -> Element:
    builder = _Builder(data, path)
    try:
        builder.parser.Parse(data, True)
    except (_RefusedError, LookupError, ValueError) as error:
        raise _refused(path, str(error), builder.here()) from error
    if builder.root is None:
        raise _refused(path, "no root element", Position(1, 1))
    return builder.root


def _check_utf8(data: bytes, path: Path) -> None:
    """Refuse other encodings than UTF-8: positions in UTF-16, which expat reads, would be wrong."""
    try:
        if "\0" not in data.decode():
            return
        place = data.index(b"\0")  # UTF-16, or no text at all
    except UnicodeDecodeError as error:
        place = error.start
    line = data.count(b"\n", 0, place) + 1
    message = "not well-formed XML: expected UTF-8 text: save it as UTF-8"
    raise _refused(path, message, Position(line, 1))


def _refused(path: Path, message: str, position: Position = WHOLE_FILE) -> TreeError:
    return TreeError(path, [Finding(str(path), position, message, rule=Rule.FILE)])


def circles(
    starts: Iterable[_T], after: Callable[[_T], Iterable[tuple[_E, _T]]]
) -> Iterator[tuple[_E, list[_T]]]:
    """Yield each use that closes a circle, with the circle from its first member to itself.

    Depth first with an explicit stack, because a chain can exceed Python's recursion limit.

    Args:
        starts: trees or files to begin with.
        after: returns the uses of a tree or file, each with the element and the used one.
    """
    done: set[_T] = set()
    for start in starts:
        chain = {} if start in done else {start: iter(after(start))}
        while chain:
            current = next(reversed(chain))
            use = next(chain[current], None)
            if use is None:
                del chain[current]
                done.add(current)
                continue
            element, used = use
            if used in chain:
                members = [*chain]
                yield element, [*members[members.index(used) :], used]
            elif used not in done:
                chain[used] = iter(after(used))


def walk(element: Element) -> Iterator[Element]:
    """Iterate over everything below an element."""
    waiting = element.children[::-1]
    while waiting:
        child = waiting.pop()
        yield child
        waiting += child.children[::-1]


# --- raw `&` and `<` in attributes: no XML, but the engine reads them -----------------------------

# Comments and the like are matched to be passed over; every quantifier is possessive.
_RAW_TAG: Final = re.compile(
    rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    rb"|<(?P<tag>[A-Za-z_:](?:[^\"'<>]++|\"[^\"]*+\"|'[^']*+')*+)>",
    re.DOTALL,
)
_VALUE: Final = re.compile(rb"\"[^\"]*+\"|'[^']*+'")
_RAW: Final = re.compile(rb"&(?!(?:[A-Za-z]+|#[0-9]+|#x[0-9A-Fa-f]+);)|<")
_ESCAPED: Final = {b"&": b"&amp;", b"<": b"&lt;"}


@dataclass(frozen=True)
class _Escaped:
    """A document whose attributes are XML."""

    data: bytes
    raw: tuple[Position, ...]  # of the escaped characters in the file
    added: dict[int, list[tuple[int, int]]]  # by line: columns, and how many more there are then

    def position(self, at: Position) -> Position:
        """Return where the file has what stands at a place of the escaped document."""
        added = sum(more for column, more in self.added.get(at.line, ()) if column < at.column)
        return Position(at.line, at.column - added)


def _escape_raw(data: bytes) -> _Escaped | None:
    """Return a document with its attributes escaped, or None when that changes nothing.

    Args:
        data: UTF-8 text.
    """
    places = [
        raw.start() + value.start() + tag.start("tag")
        for tag in _RAW_TAG.finditer(data)
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
    return _Escaped(b"".join([*parts, data[done:]]), tuple(raw), added)


def _placed_back(root: Element, escaped: _Escaped) -> Element:
    for element in (root, *walk(root)):
        element.position = escaped.position(element.position)
        for name, position in element.attribute_positions.items():
            element.attribute_positions[name] = escaped.position(position)
    root.raw = escaped.raw
    return root
