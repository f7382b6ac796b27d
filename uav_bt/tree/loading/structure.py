"""Which node an element is, and whether it has the children that it can have."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import KIND_TAGS, node_id_of
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import Element, walk
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import ReactiveSequence
from uav_bt.tree.registry import NodeRegistry

_ASYNCHRONOUS: Final = "AsyncSequence"  # the only child that the engine counts


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
