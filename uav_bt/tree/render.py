"""Drawings of a mission tree, with its subtrees in place and each node's attributes."""

from __future__ import annotations

import textwrap
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


def ascii_art(root: Box, title: str) -> str:
    """Return a tree as indented lines of ASCII characters, one for each node."""
    lines = [_one_line(title, _MAX_TITLE)]
    stack = [(root, "", True)]
    while stack:
        box, before, last = stack.pop()
        name = f"'{box.name}'" if box.name else ""
        words = " ".join(filter(None, (box.tag, name, *box.attributes)))
        lines.append(f"{before}{'`-- ' if last else '|-- '}{words}")
        inside = before + ("    " if last else "|   ")
        stack += [(child, inside, child is box.children[-1]) for child in reversed(box.children)]
    text = "\n".join([*lines, ""])
    return text.encode("ascii", "backslashreplace").decode("ascii")


_MARGIN_PX: Final = 20.0
_TOP_PX: Final = 54.0  # the title is above
_INDENT_PX: Final = 28.0
_TAG_PX: Final = 20.0  # height of a tag
_LINE_PX: Final = 15.0
_CHAR_PX: Final = 7.3  # of a fixed-width fount of 12 px, on the safe side
_COLUMNS: Final = 90  # characters of a line of attributes
_COLOURS: Final = {
    NodeKind.CONTROL: "#1f5fa8",
    NodeKind.DECORATOR: "#7a4aa3",
    NodeKind.SUBTREE: "#4d5561",
    NodeKind.ACTION: "#1d7a46",
    NodeKind.CONDITION: "#a8690c",
}
_STYLE: Final = (
    "text{font:12px 'DejaVu Sans Mono',Menlo,Consolas,monospace;fill:#1c2733}"
    ".title{font-size:16px;font-weight:bold}.tag{fill:#fff}.name{font-weight:bold}"
    ".keys{fill:#5b6775}path{fill:none;stroke:#8a96a3;stroke-width:1.5}"
)


def svg(root: Box, title: str) -> str:
    """Return a tree as an SVG image of indented rows, without founts and files from elsewhere."""
    title = _one_line(title, _MAX_TITLE)
    rows: list[str] = []
    y, width = _TOP_PX, _width(title) * 4 / 3 + 2 * _MARGIN_PX  # the title's letters are larger
    stack = [(root, _MARGIN_PX, 0.0)]
    while stack:
        box, x, parent_px = stack.pop()
        if parent_px:
            middle = y + _TAG_PX / 2
            elbow = f"M{x - _INDENT_PX + 10:.1f} {parent_px:.1f}V{middle:.1f}H{x:.1f}"
            rows.append(f'<path d="{elbow}"/>')
        tag_px = _width(box.tag) + 12
        lines = [(x + 6, 14.0, "tag", box.tag), (x + tag_px + 8, 14.0, "name", box.name)]
        below = [("given", part) for part in textwrap.wrap("  ".join(box.attributes), _COLUMNS)]
        below += [("keys", part) for keys in box.keys for part in textwrap.wrap(keys, _COLUMNS)]
        lines += [
            (x + _INDENT_PX, 34.0 + number * _LINE_PX, style, text)
            for number, (style, text) in enumerate(below)
        ]
        about = ": ".join(filter(None, (box.path, box.doc)))
        place = f'x="{x:.1f}" y="{y:.1f}" width="{tag_px:.1f}" height="{_TAG_PX:.1f}"'
        rows += [
            f"<g><title>{escape(about)}</title>",
            f'<rect {place} rx="4" fill="{_COLOURS[box.kind]}"/>',
            *(_text(left, y + down, style, text) for left, down, style, text in lines if text),
            "</g>",
        ]
        width = max(width, *(left + _width(text) + _MARGIN_PX for left, _, _, text in lines))
        stack += [(child, x + _INDENT_PX, y + _TAG_PX) for child in reversed(box.children)]
        y += _TAG_PX + len(below) * _LINE_PX + 8.0
    size = f'width="{width:.0f}" height="{y + _MARGIN_PX:.0f}"'
    head = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
        f"<title>{escape(title)}</title>",
        f"<style>{_STYLE}</style>",
        '<rect width="100%" height="100%" fill="#fff"/>',
        _text(_MARGIN_PX, 34.0, "title", title),
    ]
    return "\n".join([*head, *rows, "</svg>", ""])


def _text(x: float, y: float, style: str, text: str) -> str:
    place = f'class="{style}" x="{x:.1f}" y="{y:.1f}" xml:space="preserve"'
    return f"<text {place}>{escape(text)}</text>"


def _width(text: str) -> float:
    wide = sum(unicodedata.east_asian_width(char) in "WF" for char in text)
    return (len(text) + wide) * _CHAR_PX


FORMATS: Final[dict[str, Callable[[Box, str], str]]] = {"ascii": ascii_art, "svg": svg}
"""Functions that draw a tree from its root box and a title, by the name of the format."""
