"""Elements of a tree file: the node that each names, its attributes, and parts without meaning."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import Element, walk
from uav_bt.tree.node import NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES

KIND_TAGS: Final = frozenset(kind.value for kind in NodeKind)

# What graphical editors write for themselves; it means nothing to the engine.
EDITOR_ATTRIBUTES: Final = frozenset({"_collapsed", "_description", "_fullpath", "_uid"})


def check_attributes(element: Element, known: frozenset[str], findings: Findings) -> None:
    """Warn of attributes without meaning on an element that is not a node."""
    for attribute in element.attributes:
        if attribute in known or attribute in EDITOR_ATTRIBUTES:
            continue
        hint = did_you_mean(attribute, known)
        findings.warn(element, f"attribute '{attribute}' means nothing here{hint}", attribute)


def check_no_text(element: Element, findings: Findings) -> None:
    """Warn of text between tags, which means nothing in a tree file."""
    text = element.text.strip()
    if text:
        findings.warn(element, f"text between tags means nothing: '{text[:40]}'")


def node_id_of(element: Element) -> str:
    """Return the id of the node; `<Explore/>` and `<Action ID="Explore"/>` are the same."""
    if element.tag in KIND_TAGS and element.tag != NodeKind.SUBTREE.value:
        return element.attributes.get("ID", "")
    return element.tag


def doors(tree: Element) -> list[tuple[Element, str]]:
    """Return the SubTrees of a tree, each with the ID of its tree."""
    subtrees = (node for node in walk(tree) if node.tag == NodeKind.SUBTREE.value)
    return [(node, node.attributes.get("ID", "")) for node in subtrees]


def node_attributes(element: Element) -> dict[str, str]:
    """Return the attributes that are ports (or a subtree's entries) or conditions.

    The engine ignores others that begin with `_`.
    """
    return {
        name: text
        for name, text in element.attributes.items()
        if name in CONDITION_ATTRIBUTES or not (name in {"ID", "name"} or name.startswith("_"))
    }


def check_private_attributes(element: Element, findings: Findings) -> None:
    """Warn of a node's attributes that begin with `_` and mean nothing."""
    known = {*CONDITION_ATTRIBUTES, *EDITOR_ATTRIBUTES}
    if element.tag == NodeKind.SUBTREE.value:
        known.add("_autoremap")
    for name in element.attributes:
        if name.startswith("_") and name not in known:
            hint = did_you_mean(name, known - EDITOR_ATTRIBUTES)
            findings.warn(element, f"attribute '{name}' means nothing here{hint}", name)
