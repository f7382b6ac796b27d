"""Pictures of a tree: what a mission looks like, without flying it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.render.sketch import Box, sketch
from uav_bt.tree.render.svg import svg
from uav_bt.tree.render.texts import ascii_art, dot, mermaid

__all__ = ["FORMATS", "render"]

FORMATS: Final[dict[str, Callable[[Box, str], str]]] = {
    "ascii": ascii_art,
    "svg": svg,
    "dot": dot,
    "mermaid": mermaid,
}
"""What draws a tree's root box under a title, by the format's name."""


def render(tree: MissionTree, format_: str) -> str:
    """Return a tree as a picture: its subtrees in place, each node with what the file gives it.

    Args:
        tree: the tree; it need not be set up.
        format_: one of `FORMATS`.

    Raises:
        KeyError: there is no such format.
    """
    return FORMATS[format_](sketch(tree.root), tree.name)
