"""Reader of tree files: XML without document types and entities, with the place of every part.

The engine's reader takes some text that is no XML. It is mended without moving anything, so that
expat's lines and columns hold, and noted in `Element.mended`.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Final, NoReturn, TypeVar
from xml.etree import ElementTree as ET
from xml.parsers import expat

from uav_bt.errors import TreeError
from uav_bt.files import read_bounded
from uav_bt.tree.loading.findings import MAX_FINDINGS, WHOLE_FILE, Finding, Position, Rule

_T = TypeVar("_T", bound=Hashable)
_E = TypeVar("_E")

MAX_BYTES: Final = 2_000_000  # a mission has some kilobytes
_SMALLER: Final = "SubTrees can stand in other files"
MAX_DEPTH: Final = 256  # levels; the engine's own limit
MAX_NODES: Final = 20_000  # of a file, and of a tree: subtrees inside subtrees multiply
_MAX_ATTRIBUTES: Final = 200  # of one element; nodes have less than ten
_MAX_WORD: Final = 20_000  # characters of a name or an attribute; scripts have some dozens
_MAX_TEXT: Final = 1_000  # characters kept of a text between tags; it only serves messages

# Of what expat has accepted.
_TAG: Final = re.compile(rb"<(?:[^\"'>]++|\"[^\"]*+\"|'[^']*+')*+>")
_ATTRIBUTE: Final = re.compile(r"\s([^\s=]++)\s*+=\s*+(?:\"[^\"]*+\"|'[^']*+')")


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
    mended: list[tuple[Position, str]] = field(default_factory=list)  # of a root: what is no XML

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


def read_source(path: Path) -> bytes:
    """Return a tree file's bytes, or raise a TreeError: it cannot be read, or is too large."""
    return read_bounded(path, MAX_BYTES, _refused, cure=_SMALLER)


def _parsed(text: str, path: Path) -> Element:
    """Return the root element of a document that is XML."""
    data = text.encode()
    # Whatever the declaration says, as the format's own engine has it.
    parser = expat.ParserCreate("UTF-8")
    parser.buffer_text = True
    document = Element(path, "", {}, Position(1, 1), dict)
    found, around = [document], [document]

    def here() -> Position:
        return Position(parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def refuse(message: str, *_arguments: object) -> NoReturn:
        raise _refused(path, message, here())

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(found) > MAX_NODES:
            refuse(f"more than {MAX_NODES} elements")
        if len(around) >= MAX_DEPTH + 3:  # the nodes stand in <root> and <BehaviorTree>
            refuse(f"nodes are nested deeper than {MAX_DEPTH}")
        if len(attributes) > _MAX_ATTRIBUTES:
            refuse(f"an element has more than {_MAX_ATTRIBUTES} attributes")
        if max(map(len, (tag, *attributes, *attributes.values()))) > _MAX_WORD:
            refuse(f"a name or an attribute is longer than {_MAX_WORD} characters")
        at = here()
        locate = partial(_locate, data, parser.CurrentByteIndex, at)
        given = {name: value.translate(_RAW_OF) for name, value in attributes.items()}
        element = Element(path, tag, given, at, locate)
        around[-1].children.append(element)
        found.append(element)
        around.append(element)

    def characters(text: str) -> None:
        words = text.strip().translate(_RAW_OF)
        if words and len(around[-1].text) < _MAX_TEXT:
            around[-1].text += words[:_MAX_TEXT]

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _tag: around.pop()
    parser.CharacterDataHandler = characters
    no_types = "document type declarations and entities are not allowed"
    parser.StartDoctypeDeclHandler = partial(refuse, no_types)
    parser.Parse(data, True)
    return found[1]


def _locate(data: bytes, start: int, here: Position) -> dict[str, Position]:
    """Return where each attribute of a tag stands, by name; the tag begins `here`, at a byte."""
    tag = _TAG.match(data, start)
    text = tag[0].decode() if tag else ""
    return {one[1]: _position(text, one.start(1), here) for one in _ATTRIBUTE.finditer(text)}


def _position(text: str, at: int, here: Position) -> Position:
    """Return the place of a character in a text that begins `here`."""
    newlines = text.count("\n", 0, at)
    column = at - text.rfind("\n", 0, at) if newlines else here.column + at
    return Position(here.line + newlines, column)


def parse_source(data: bytes, path: Path) -> Element:
    """Return the root element of a document, or raise a TreeError: no XML, or beyond a limit."""
    if len(data) > MAX_BYTES:
        raise _refused(path, f"larger than {MAX_BYTES} bytes: {_SMALLER}")
    text = _decoded(data, path)
    try:
        return _parsed(text, path)
    except expat.ExpatError as error:
        with contextlib.suppress(expat.ExpatError):
            return _mended(text, path)
        reason = expat.errors.messages[error.code]
        begin = text.removeprefix(_BOM).strip()
        if begin and not begin.startswith("<"):
            line = begin.partition("\n")[0][:40].rstrip()
            reason = f"expected a tag such as <root>, got '{line}'"
        where = Position(error.lineno, error.offset + 1)
        raise _refused(path, f"not well-formed XML: {reason}", where) from error


def _decoded(data: bytes, path: Path) -> str:
    """Refuse other encodings than UTF-8: positions in UTF-16, which expat reads, would be wrong."""
    try:
        text, place = data.decode(), data.find(b"\0")  # a zero byte: UTF-16, or no text at all
    except UnicodeDecodeError as error:
        text, place = "", error.start
    if place >= 0:
        message = "not well-formed XML: expected UTF-8 text: save it as UTF-8"
        raise _refused(path, message, Position(data.count(b"\n", 0, place) + 1, 1))
    return text


def _refused(path: Path, message: str, position: Position = WHOLE_FILE) -> TreeError:
    return TreeError(path, [Finding(str(path), position, message, rule=Rule.FILE)])


# --- what is no XML, but the engine reads it ------------------------------------------------------

_BOM: Final = "\ufeff"
# Raw `&` and `<` become these, and are themselves again when the tag is read.
_STAND_INS: Final = {"&": "\ufdd0", "<": "\ufdd1"}
_RAW_OF: Final = {ord(stand_in): letter for letter, stand_in in _STAND_INS.items()}
_PART: Final = re.compile(
    rf"\A{_BOM}?\s+(?P<declaration><\?xml\s.*?\?>)|<\?.*?\?>|<!\[CDATA\[.*?\]\]>"
    r"|<!--(?P<comment>.*?)-->|(?P<tag></?[^\s\"'<>!?/](?:[^\"'<>]++|\"[^\"]*+\"|'[^']*+')*+>)"
    r"|(?P<text>[^<]++)",
    re.DOTALL,
)
_QUOTED: Final = re.compile(r"\"[^\"]*+\"|'[^']*+'")
_RAW: Final = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]++|#x[0-9A-Fa-f]++);)(\w++;)?|<")

_Change = tuple[int, str, str]  # the place, the text that comes there, and a message


def _mended(text: str, path: Path) -> Element:
    """Return the root element of a document that the engine reads, though it is no XML."""
    changes, letters = _changes(text), list(text)
    for at, new, _ in changes:
        letters[at : at + len(new)] = new
    root = _parsed("".join(letters), path)
    start = Position(1, 1)
    root.mended = [(_position(text, at, start), why) for at, _, why in changes[:MAX_FINDINGS]]
    return root


def _changes(text: str) -> list[_Change]:
    """Return what makes a document XML; none where no part of XML can be recognised."""
    changes: list[_Change] = []
    done = 0
    while done < len(text):  # part after part, so that the time is linear in the length
        part = _PART.match(text, done)
        if part is None:
            return []
        done = part.end()
        if part["declaration"]:
            message = "blanks before '<?xml' are not XML: remove them"
            changes.append((part.start("declaration"), _blank(part["declaration"]), message))
        elif part["comment"] and "--" in f"{part['comment']}-":
            dashes = f"{part['comment']}-".index("--")
            at, new = part.start("comment") + dashes, _blank(part["comment"][dashes:])
            changes.append((at, new, "'--' in a comment is not XML: write something else"))
        elif part["text"]:
            changes += _escapes(part["text"], part.start())
        elif part["tag"]:
            for value in _QUOTED.finditer(part["tag"]):
                changes += _escapes(value[0], part.start() + value.start())
    return changes


def _blank(text: str) -> str:
    return re.sub(r"\S", " ", text)


def _escapes(text: str, start: int) -> Iterator[_Change]:
    for raw in _RAW.finditer(text):
        message = "a raw '&' or '<' is not XML: write &amp; or &lt;"
        if raw[1]:
            message = f"XML has no entity '{raw[0]}': it stays text; write &amp;{raw[1]}"
        yield start + raw.start(), _STAND_INS[raw[0][0]], message


# --- walks over elements --------------------------------------------------------------------------


def circles(
    starts: Iterable[_T], after: Callable[[_T], Iterable[tuple[_E, _T]]]
) -> Iterator[tuple[_E, list[_T]]]:
    """Yield each use that closes a circle, with the circle from its first member to itself.

    `after` returns the uses of a tree or file, each with the element and the used one. Depth first
    with an explicit stack, because a chain can exceed Python's recursion limit.
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


def to_xml(element: Element) -> ET.Element:
    """Return an element with all below it for a writer of XML."""
    copy = ET.Element(element.tag, element.attributes)
    copy.text = element.text or None
    copy.extend(map(to_xml, element.children))
    return copy
