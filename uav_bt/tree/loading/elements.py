"""Elements of a tree file: the node that each is, its attributes and its children."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import Element, circles, walk
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import ReactiveSequence
from uav_bt.tree.registry import NodeRegistry

if TYPE_CHECKING:
    from uav_bt.tree.loading.document import Document

KIND_TAGS: Final = frozenset(kind.value for kind in NodeKind)
_ASYNCHRONOUS: Final = "AsyncSequence"  # the only child that the engine counts

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


def node_class(element: Element, document: Document, findings: Findings) -> type[Node] | None:
    """Return the class of a node that is no SubTree; None for an unknown one."""
    node_id = node_id_of(element)
    if not node_id:
        findings.note(element, f"<{element.tag}> needs an attribute 'ID'", rule=Rule.ATTRIBUTE)
        return None
    node = document.registry.get(node_id)
    if node is None:
        attribute = "ID" if element.tag in KIND_TAGS else ""
        message = f"unknown node '{node_id}'{_other_node(node_id, document)}"
        findings.note(element, message, attribute, rule=Rule.UNKNOWN_NODE)
        return None
    if element.tag in KIND_TAGS and element.tag != node.kind.value:
        message = f"'{node_id}' is of kind {node.kind.value}, not {element.tag}"
        findings.warn(element, message, "ID", rule=Rule.UNKNOWN_NODE)
    elif element.tag not in KIND_TAGS and "ID" in element.attributes:
        message = "unknown attribute 'ID': the tag says which node it is"
        findings.note(element, message, "ID", rule=Rule.ATTRIBUTE)
    _check_children(element, node.min_children, node.max_children, findings)
    if node is ReactiveSequence:
        running = [child for child in element.children if child.tag == _ASYNCHRONOUS]
        for child in running[1:]:
            message = f"a ReactiveSequence can have one {_ASYNCHRONOUS}: each stops the others"
            findings.note(child, f"{message} when it runs", rule=Rule.CHILDREN)
    return node


def _other_node(node_id: str, document: Document) -> str:
    """Return what may be meant by an unknown node."""
    if node_id in document.trees:
        return f'; it is a tree of this file: write <SubTree ID="{node_id}"/>'
    registry = document.registry
    hint = did_you_mean(node_id, [*registry, *document.lookup.described])
    hint = hint or "; --leaves FILE.py or an installed package adds nodes"
    return hint + "".join(f"; not loaded: {fault}" for fault in registry.faults)


def check_subtree(element: Element, registry: NodeRegistry, findings: Findings) -> None:
    """Refuse a SubTree that has children, or that names no tree."""
    _check_children(element, 0, 0, findings)
    tree_id = element.attributes.get("ID", "")
    if not tree_id:
        findings.note(element, "attribute 'ID' is missing", rule=Rule.ATTRIBUTE)
    elif tree_id in registry:
        message = f"'{tree_id}' is a node, no tree: write <{tree_id}/>"
        findings.note(element, message, "ID", rule=Rule.UNKNOWN_TREE)


def _check_children(element: Element, least: int, most: int | None, findings: Findings) -> None:
    count = len(element.children)
    if count >= least and (most is None or count <= most):
        return
    if most is None:
        needed = f"at least {least}"
    elif most != least:
        needed = f"{least} to {most} children"
    else:
        words = {0: "no children", 1: "exactly one child"}
        needed = words.get(least, f"exactly {least} children")
    findings.note(element, f"needs {needed}, has {count}", rule=Rule.CHILDREN)


def check_names(tree: Element, findings: Findings) -> None:
    """Refuse two SubTrees of one name under one tree, as the engine does since 4.8.4."""
    first: dict[str, Element] = {}
    for element in walk(tree):
        name = element.attributes.get("name") if element.tag == NodeKind.SUBTREE.value else None
        if not name or first.setdefault(name, element) is element:
            continue
        if {"ID", "name"} <= element.attribute_positions.keys():  # no short form
            findings.note(
                element,
                f"the SubTree at {first[name].path}:{first[name].position} has this name, too: "
                "names of SubTrees are unique in a tree; leave it out, or choose another",
                "name",
                rule=Rule.TREE_ID,
            )


def check_recursion(document: Document, findings: Findings) -> None:
    """Refuse trees that contain themselves."""
    trees = document.trees

    def used(tree_id: str) -> list[tuple[Element, str]]:
        return [(node, inner) for node, inner in doors(trees[tree_id]) if inner in trees]

    for node, loop in circles(trees, used):
        message = f"the tree contains itself: {' > '.join(loop)}"
        findings.note(node, message, "ID", rule=Rule.UNKNOWN_TREE)
