"""Drawings of a mission tree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from uav_bt.tree.node import Node
from uav_bt.tree.render.sketch import Box, one_line, sketch
from uav_bt.tree.render.svg import svg

__all__ = ["FORMATS", "ascii_art", "render"]


def ascii_art(root: Box, title: str) -> str:
    """Return a tree as indented lines of ASCII characters, one for each node.

    Args:
        root: the uppermost box.
        title: the first line.
    """
    lines = [one_line(title, 60)]
    stack = [(root, "", True)]
    while stack:
        box, before, last = stack.pop()
        lines.append(f"{before}{'`-- ' if last else '|-- '}{_summary(box)}")
        inside = before + ("    " if last else "|   ")
        stack += [(child, inside, child is box.children[-1]) for child in reversed(box.children)]
    text = "\n".join([*lines, ""])
    return text.encode("ascii", "backslashreplace").decode("ascii")


def _summary(box: Box) -> str:
    name = f"'{box.name}'" if box.name else ""
    return " ".join(text for text in (box.tag, name, *box.attributes) if text)


FORMATS: Final[dict[str, Callable[[Box, str], str]]] = {"ascii": ascii_art, "svg": svg}
"""Functions that draw a tree from its root box and a title, by the name of the format."""


class Drawable(Protocol):
    """A tree, as far as drawings need it."""

    root: Node
    name: str


def render(tree: Drawable, format_: str) -> str:
    """Return a drawing of a tree with its subtrees in place, and each node's attributes.

    Args:
        tree: the tree; it need not be set up.
        format_: one of `FORMATS`.

    Raises:
        KeyError: `format_` is not one of `FORMATS`.
    """
    return FORMATS[format_](sketch(tree.root), tree.name)
