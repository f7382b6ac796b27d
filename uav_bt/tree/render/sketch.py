"""What stands in the box of a node, in few words; the same for every format."""

from __future__ import annotations

import textwrap
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from uav_bt.errors import BoardAccessError
from uav_bt.tree.describe import summary
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.port import Port, port_text

_MAX_TEXT: Final = 36  # characters; longer lines make a tree too wide to see at once


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

    def walk(self) -> Iterator[Box]:
        """Iterate over this box and all below, parents first."""
        stack = [self]
        while stack:
            box = stack.pop()
            yield box
            stack.extend(reversed(box.children))


def one_line(text: str, longest: int = _MAX_TEXT) -> str:
    """Return a text without line breaks and control characters, shortened where it is long.

    Args:
        text: any text.
        longest: how many characters are left.
    """
    visible = "".join(" " if unicodedata.category(char)[0] == "C" else char for char in text)
    words = " ".join(visible.split())
    return words if len(words) <= longest else f"{words[: longest - 3]}..."


def sketch(root: Node) -> Box:
    """Return the box of a node, with those of all below it."""
    made: dict[int, Box] = {}
    # Children first; no recursion, because a tree composed in Python may be of any depth.
    order = [root]
    for node in order:
        order.extend(node.children)
    for node in reversed(order):
        made[id(node)] = _box(node, tuple(made[id(child)] for child in node.children))
    return made[id(root)]


def _box(node: Node, children: tuple[Box, ...]) -> Box:
    usual = node.tree_id if type(node) is SubTree else node.node_id
    tag = f"SubTree {usual}" if type(node) is SubTree else usual
    return Box(
        tag=one_line(tag),
        name="" if node.name == usual else one_line(node.name),
        kind=node.kind,
        attributes=tuple(one_line(f"{name}={text}") for name, text in _given(node)),
        keys=tuple(_keys(node)),
        path=one_line(node.path, 500),
        doc=one_line(summary(type(node)), 200),
        children=children,
    )


def _given(node: Node) -> Iterator[tuple[str, str]]:
    for port in node.ports:
        text = _port_given(node, port)
        if text is not None:
            yield port.name, text
    if isinstance(node, SubTree):
        yield from node.attributes.items()
    yield from node.condition_scripts.items()


def _port_given(node: Node, port: Port[Any]) -> str | None:
    default = None if port.default is Port.REQUIRED else port.default
    reference = node.reference(port)
    if reference is not None:
        usual = port.bind(default) if isinstance(default, str) else None
        return None if reference == usual else str(reference)
    if port.direction != "input":
        return None
    try:
        value = node.port_value(port.name)
    except BoardAccessError:  # a palette's port, neither given nor with a default
        return None
    return f"{value:g}" if isinstance(value, float) else port_text(value) or None


def _keys(node: Node) -> Iterable[str]:
    if isinstance(node, Leaf):
        for word, keys in (("reads", node.reads), ("writes", node.writes)):
            names = ", ".join(key.name for key in keys)
            yield from _wrapped(f"{word} {names}" if names else "")


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, _MAX_TEXT, subsequent_indent="  ")
