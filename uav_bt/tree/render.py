"""Drawings of a mission tree, with its subtrees in place and each node's attributes."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final
from xml.sax.saxutils import escape

from uav_bt.tree.describe import summary
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.port import Port, port_text

_MAX_TEXT: Final = 36  # characters of a name or an attribute
_MAX_TITLE: Final = 60


def render(root: Node, title: str, format_: str) -> str:
    """Return a drawing of a tree, which need not be set up, in one of `FORMATS`."""
    return FORMATS[format_](sketch(root), title)


# --- what is drawn of a node ----------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Box:
    """A node as it is drawn. All texts are single lines without control characters."""

    tag: str
    name: str  # empty when the tag says it all
    kind: NodeKind
    attributes: tuple[str, ...]  # `name=value`; references where they differ from the default
    keys: tuple[str, ...]  # that it reads from and writes to the board
    path: str
    doc: str
    children: tuple[Box, ...]


def sketch(node: Node) -> Box:
    """Return the box of a node, with those of all below it."""
    usual = node.tree_id if type(node) is SubTree else node.node_id
    keys = (("reads", node.reads), ("writes", node.writes)) if isinstance(node, Leaf) else ()
    return Box(
        tag=_one_line(f"SubTree {usual}" if type(node) is SubTree else usual),
        name="" if node.name == usual else _one_line(node.name),
        kind=node.kind,
        attributes=tuple(_one_line(f"{name}={text}") for name, text in _given(node)),
        keys=tuple(f"{word} {', '.join(key.name for key in some)}" for word, some in keys if some),
        path=_one_line(node.path, 500),
        doc=_one_line(summary(type(node)), 200),
        children=tuple(map(sketch, node.children)),
    )


def _one_line(text: str, longest: int = _MAX_TEXT) -> str:
    """Return a text without line breaks and control characters, shortened where it is long."""
    visible = "".join(" " if unicodedata.category(char)[0] == "C" else char for char in text)
    words = " ".join(visible.split())
    return words if len(words) <= longest else f"{words[: longest - 3]}..."


def _given(node: Node) -> Iterator[tuple[str, str]]:
    for port in node.ports:
        at, value = node.reference(port), node.literals.get(port.name)
        if at is not None:
            if port.default is Port.REQUIRED or at != port.bound_default:
                yield port.name, str(at)
        elif port.direction == "input" and value is not None:
            text = f"{value:g}" if isinstance(value, float) else port_text(value)
            if text:
                yield port.name, text
    if isinstance(node, SubTree):
        yield from node.attributes.items()
    yield from node.condition_scripts.items()


# --- the forms ------------------------------------------------------------------------------------


def _lines(root: Box) -> Iterator[tuple[str, Box, str]]:
    """Yield what a line of a tree begins with, its node, and what else it says of the node."""
    stack = [(root, "", True)]
    while stack:
        box, before, last = stack.pop()
        name = f"'{box.name}'" if box.name else ""
        yield (
            f"{before}{'`-- ' if last else '|-- '}",
            box,
            " ".join([name, *box.attributes]).strip(),
        )
        inside = before + ("    " if last else "|   ")
        stack += [(child, inside, child is box.children[-1]) for child in reversed(box.children)]


def ascii_art(root: Box, title: str) -> str:
    """Return a tree as indented lines of ASCII characters, one for each node."""
    lines = [f"{lead}{box.tag} {more}".rstrip() for lead, box, more in _lines(root)]
    text = "\n".join([_one_line(title, _MAX_TITLE), *lines, ""])
    return text.encode("ascii", "backslashreplace").decode("ascii")


_LINE_PX: Final = 18
_CHAR_PX: Final = 7.3  # of a fixed-width fount of 12 px, on the safe side
_COLOURS: Final = {
    NodeKind.CONTROL: "#1f5fa8",
    NodeKind.DECORATOR: "#7a4aa3",
    NodeKind.SUBTREE: "#4d5561",
    NodeKind.ACTION: "#1d7a46",
    NodeKind.CONDITION: "#a8690c",
}
_STYLE: Final = (
    "text{font:12px 'DejaVu Sans Mono',Menlo,Consolas,monospace;fill:#5b6775;white-space:pre}"
    ".tag{font-weight:bold}"
)


def svg(root: Box, title: str) -> str:
    """Return a tree as an SVG image of lines, a colour for each kind of node."""
    title = _one_line(title, _MAX_TITLE)
    rows, widest = [f'<text x="20" y="26">{escape(title)}</text>'], _width(title)
    for number, (lead, box, more) in enumerate(_lines(root), 2):
        about = "\n".join(filter(None, (f"{box.path}: {box.doc}", *box.keys)))
        tag = f'<tspan class="tag" fill="{_COLOURS[box.kind]}">{escape(box.tag)}</tspan>'
        rows.append(
            f'<text x="20" y="{8 + number * _LINE_PX}"><title>{escape(about)}</title>'
            f"{lead}{tag} {escape(more)}</text>"
        )
        widest = max(widest, _width(f"{lead}{box.tag} {more}"))
    size = f'width="{widest * _CHAR_PX + 40:.0f}" height="{len(rows) * _LINE_PX + 40}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">'
    top = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        head,
        f"<title>{escape(title)}</title>",
        f"<style>{_STYLE}</style>",
    ]
    return "\n".join([*top, '<rect width="100%" height="100%" fill="#fff"/>', *rows, "</svg>", ""])


def _width(text: str) -> int:
    return len(text) + sum(unicodedata.east_asian_width(char) in "WF" for char in text)


FORMATS: Final[dict[str, Callable[[Box, str], str]]] = {"ascii": ascii_art, "svg": svg}
"""Functions that draw a tree from its root box and a title, by the name of the format."""
