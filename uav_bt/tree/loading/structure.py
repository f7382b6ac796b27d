"""Checks of every tree of a file, used or not: known nodes and numbers of children."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import (
    KIND_TAGS,
    check_no_text,
    check_private_attributes,
    node_id_of,
)
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import Element, walk
from uav_bt.tree.node import NodeKind
from uav_bt.tree.nodes import ReactiveSequence
from uav_bt.tree.registry import NodeRegistry

_ASYNCHRONOUS: Final = "AsyncSequence"  # the only child that the engine counts


def check_structure(tree: Element, document: Document, findings: Findings) -> None:
    """Add a finding for each fault of a tree's nodes and their children.

    Args:
        tree: the BehaviorTree element.
        document: the file's outline.
        findings: collects the findings.
    """
    for element in walk(tree):
        check_no_text(element, findings)
        check_private_attributes(element, findings)
        if element.tag == NodeKind.SUBTREE.value:
            _check_subtree(element, document.registry, findings)
        else:
            _check_node(element, document, findings)
    _check_names(tree, findings)


def _check_subtree(element: Element, registry: NodeRegistry, findings: Findings) -> None:
    _check_children(element, 0, 0, findings)
    tree_id = element.attributes.get("ID", "")
    if not tree_id:
        findings.note(element, "attribute 'ID' is missing", rule=Rule.ATTRIBUTE)
    elif tree_id in registry:
        message = f"'{tree_id}' is a node, no tree: write <{tree_id}/>"
        findings.note(element, message, "ID", rule=Rule.UNKNOWN_TREE)


def _check_node(element: Element, document: Document, findings: Findings) -> None:
    node_id = node_id_of(element)
    if not node_id:
        findings.note(element, f"<{element.tag}> needs an attribute 'ID'", rule=Rule.ATTRIBUTE)
        return
    if node_id not in document.registry:
        _note_unknown(element, node_id, document, findings)
        return
    node = document.registry[node_id]
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
            findings.note(
                child,
                f"a ReactiveSequence can have one {_ASYNCHRONOUS}: each stops the others when it "
                "runs",
                rule=Rule.CHILDREN,
            )


def _note_unknown(
    element: Element,
    node_id: str,
    document: Document,
    findings: Findings,
) -> None:
    if node_id in document.trees:
        hint = f'; it is a tree of this file: write <SubTree ID="{node_id}"/>'
    else:
        registry = document.registry
        hint = did_you_mean(node_id, [*registry, *document.lookup.described])
        hint = hint or "; --leaves FILE.py or an installed package adds nodes"
        hint += "".join(f"; not loaded: {fault}" for fault in registry.faults)
    attribute = "ID" if element.tag in KIND_TAGS else ""
    findings.note(element, f"unknown node '{node_id}'{hint}", attribute, rule=Rule.UNKNOWN_NODE)


def _check_children(
    element: Element, min_count: int, max_count: int | None, findings: Findings
) -> None:
    count = len(element.children)
    if count >= min_count and (max_count is None or count <= max_count):
        return
    if max_count is None:
        needed = f"at least {min_count}"
    elif max_count != min_count:
        needed = f"{min_count} to {max_count} children"
    else:
        needed = {0: "no children", 1: "exactly one child"}.get(
            min_count, f"exactly {min_count} children"
        )
    findings.note(element, f"needs {needed}, has {count}", rule=Rule.CHILDREN)


def _check_names(tree: Element, findings: Findings) -> None:
    """Refuse two SubTrees of one name under one tree, as the engine does since 4.8.4."""
    first: dict[str, Element] = {}
    for element in walk(tree):
        name = element.attributes.get("name") if element.tag == NodeKind.SUBTREE.value else None
        taken = name and first.setdefault(name, element) is not element
        if taken and {"ID", "name"} <= element.attribute_positions.keys():  # no short form
            findings.note(
                element,
                f"the SubTree at {first[name].path}:{first[name].position} has this name, too: "
                "names of SubTrees are unique in a tree; leave it out, or choose another",
                "name",
                rule=Rule.TREE_ID,
            )
