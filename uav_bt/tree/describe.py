"""What nodes there are, as data, text and model for editors; drawings of trees."""

from __future__ import annotations

import inspect
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape

from uav_bt.board.blackboard import Key
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.source import to_xml
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import BUILTIN_NODES, SubTree
from uav_bt.tree.port import PORT_TYPES, Port, port_text
from uav_bt.tree.registry import NodeRegistry

ABILITIES: Final = {"moves": "moves", "points": "points the camera", "lands": "lands"}
"""Class attributes of leaves for their effect on the drone, each with its description."""

# A value of each type, for ports that a tree file must give.
_SAMPLES: Final = {float: "1.0", int: "1", bool: "true"}


class Declared(NamedTuple):
    """Names of what a leaf declares; nothing for another node."""

    reads: tuple[str, ...] = ()  # board keys
    writes: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()  # the statuses that it gives
    abilities: tuple[str, ...] = ()  # moves, points, lands


def summary(node: type[Node]) -> str:
    """Return the first line of a node class's docstring."""
    return (node.__doc__ or "").strip().partition("\n")[0].strip()


def default_text(port: Port[Any]) -> str | None:
    """Return the default of a port as a tree file has it; None if there is none."""
    return None if port.default is Port.REQUIRED else port_text(port.default)


def _names(keys: Iterable[Key[Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(key.name for key in keys))


def declared(node: type[Node]) -> Declared:
    """Return what a node declares besides its ports."""
    if not issubclass(node, Leaf):
        return Declared()
    return Declared(
        reads=_names(node.reads),
        writes=_names(node.writes),
        answers=tuple(answer.name for answer in node.answers),
        abilities=tuple(name for name in ABILITIES if getattr(node, name, False)),
    )


def origin(node: type[Node]) -> str:
    """Return module and name of a node's class."""
    return f"{node.__module__}.{node.__qualname__}"


def in_order(registry: NodeRegistry) -> list[type[Node]]:
    """Return all nodes of a registry: missions' own first, then the format's, by kind and name."""
    kinds, nodes = list(NodeKind), (registry[node_id] for node_id in registry)
    return sorted(nodes, key=lambda one: (one in BUILTIN_NODES, kinds.index(one.kind), one.node_id))


def own_nodes(registry: NodeRegistry) -> list[type[Node]]:
    """Return the nodes that are not the format's."""
    return [registry[name] for name in registry if registry[name] not in BUILTIN_NODES]


# --- a node in Markdown ---------------------------------------------------------------------------


def example(node: type[Node]) -> str:
    """Return a tag of the node with its outputs, and a value for each port that needs one."""
    given = {port.name: _sample(port) for port in node.ports if port.required}
    given |= {port.name: f"{{{port.name}}}" for port in node.ports if port.direction == "output"}
    return " ".join([f"<{node.node_id}", *(f'{name}="{given[name]}"' for name in given)]) + "/>"


def section(node: type[Node], heading: str = "##") -> Iterator[str]:
    """Yield the paragraphs about a node."""
    found = declared(node)
    yield f"{heading} {node.node_id}"
    # The attributes of a class have a table here.
    yield inspect.cleandoc(node.__doc__ or "").partition("\nArgs:")[0].strip()
    yield f"Example: `{example(node)}`"
    if node.ports:
        head = ["| port | type | default | meaning |", "|---|---|---|---|"]
        yield "\n".join([*head, *map(_row, node.ports)])
    answers = f" Answers {', '.join(found.answers)}." if found.answers else ""
    abilities = [ABILITIES[name] for name in found.abilities]
    does = f" It {' and '.join(abilities)}." if abilities else ""
    keys = "".join(
        f" {verb} {', '.join(f'`{key}`' for key in keys)}."
        for verb, keys in (("Reads", found.reads), ("Writes", found.writes))
        if keys
    )
    yield f"{node.kind.value}.{answers}{does}{keys} Source: `{origin(node)}`."


def _sample(port: Port[Any]) -> str:
    return port.sample or port_text((*port.choices, _SAMPLES.get(port.type, "name"))[0])


def _row(port: Port[Any]) -> str:
    default = default_text(port)
    value = "required" if port.required else f"`{default}`" if default else ""
    value = "output" if port.direction == "output" else value
    doc = _doc(port).replace("|", "\\|")
    return f"| `{port.name}` | {port.type.__name__} | {value} | {doc} |"


def _doc(port: Port[Any]) -> str:
    return f"{port.doc} ({port.range})" if port.range else port.doc


# --- a model for graphical editors ----------------------------------------------------------------


def palette_xml(registry: NodeRegistry) -> str:
    """Return a TreeNodesModel of the nodes that are not the format's, and of described trees.

    A graphical editor imports it and offers the nodes with their ports. The loader accepts the
    files that the editor saves.
    """
    root = ET.Element("root", BTCPP_format="4")
    model = ET.SubElement(root, "TreeNodesModel")
    for node in own_nodes(registry):
        add_model(model, node)
    model.extend(map(to_xml, Lookup().described.values()))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def add_model(models: ET.Element, node: type[Node]) -> None:
    """Add a node to a TreeNodesModel."""
    element = ET.SubElement(models, node.kind.value, ID=node.node_id)
    for port in node.ports:
        known = PORT_TYPES.get(port.type)
        name = port.type.__name__ if known is None else known.cpp_name
        entry = ET.SubElement(element, f"{port.direction}_port", name=port.name, type=name)
        if (default := default_text(port)) is not None:
            entry.set("default", default)
        entry.text = _doc(port)


# --- drawings of trees ----------------------------------------------------------------------------

_MAX_TEXT: Final = 36  # characters of a name or an attribute
_MAX_TITLE: Final = 60


def render(root: Node, title: str, format_: str) -> str:
    """Return a drawing of a tree, which need not be set up, in one of `FORMATS`."""
    return FORMATS[format_](sketch(root), title)


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


def _lines(root: Box) -> Iterator[tuple[str, Box, str]]:
    """Yield what a line of a tree begins with, its node, and what else it says of the node."""
    stack = [(root, "", True)]
    while stack:
        box, before, last = stack.pop()
        more = " ".join([f"'{box.name}'" if box.name else "", *box.attributes]).strip()
        yield f"{before}{'`-- ' if last else '|-- '}", box, more
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
    "<style>"
    "text{font:12px 'DejaVu Sans Mono',Menlo,Consolas,monospace;fill:#5b6775;white-space:pre}"
    ".tag{font-weight:bold}</style>\n"
    '<rect width="100%" height="100%" fill="#fff"/>'
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
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" xml:space="preserve">'
    top = ['<?xml version="1.0" encoding="UTF-8"?>', head, f"<title>{escape(title)}</title>"]
    return "\n".join([*top, _STYLE, *rows, "</svg>", ""])


def _width(text: str) -> int:
    return len(text) + sum(unicodedata.east_asian_width(char) in "WF" for char in text)


FORMATS: Final[dict[str, Callable[[Box, str], str]]] = {"ascii": ascii_art, "svg": svg}
"""Functions that draw a tree from its root box and a title, by the name of the format."""
