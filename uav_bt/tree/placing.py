"""Gives the nodes of a tree their paths and their variables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from uav_bt.tree.node import Node
from uav_bt.tree.variables import Variables


def child_paths(parent: str, names: Sequence[str]) -> list[str]:
    """Return the paths of a node's children by their names; the second of one name gets `#2`."""
    seen: Counter[str] = Counter()
    paths: list[str] = []
    for name in names:
        seen[name] += 1
        paths.append(f"{parent}/{name}" + (f"#{seen[name]}" if seen[name] > 1 else ""))
    return paths


def place_tree(root: Node, path: str, variables: Variables) -> None:
    """Place a node in the variables of its tree, and all below; each subtree gets a scope."""
    root.place(path, variables)
    inner = root.open_scope(variables)
    paths = child_paths(path, [child.name for child in root.children])
    for child, child_path in zip(root.children, paths, strict=True):
        place_tree(child, child_path, inner)
