"""Findings at the nodes of a loaded tree."""

from __future__ import annotations

from uav_bt.tree.loading.findings import Finding, Position, Rule
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node


def finding_at(tree: MissionTree, node: Node, message: str, rule: Rule) -> Finding:
    """Return a finding at the place of a node in its file.

    Args:
        tree: loaded from a file.
        node: one of its nodes.
        message: the mistake and the remedy.
        rule: the broken rule.
    """
    place = tree.places.get(node.path)
    path, position = (tree.path, Position(1, 1)) if place is None else (place.path, place.position)
    return Finding(str(path), position, message, node.path, rule=rule)
