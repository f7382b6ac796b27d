"""Checks every tree of a file, node by node, before anything is built."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES, check_condition
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import (
    KIND_TAGS,
    Element,
    check_no_text,
    node_attributes,
    node_id_of,
    walk,
)
from uav_bt.tree.loading.variable_checker import check_variables, key_fits
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port, Reference, bind_ports, parse_reference
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.script import parse_script
from uav_bt.tree.script.expressions import Name

_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")


class Checker:
    """Notes all that is wrong with the trees of a document.

    Args:
        document: the file's outline.
        registry: the nodes that may occur.
        findings: where they are added.
    """

    def __init__(self, document: Document, registry: NodeRegistry, findings: Findings) -> None:
        self._document = document
        self._registry = registry
        self._findings = findings
        self._board_keys = registry.board_keys

    def check(self) -> None:
        """Check all trees, those that nothing refers to included."""
        for tree in self._document.trees.values():
            for child in tree.children:
                self._check_node(child)
        self._check_recursion()
        check_variables(self._document, self._registry, self._findings)

    def _note(self, element: Element, message: str, attribute: str = "") -> None:
        self._findings.note(element, message, attribute)

    def _check_node(self, element: Element) -> None:
        for child in element.children:
            self._check_node(child)
        self.check_element(element)

    def check_element(self, element: Element) -> None:
        """Check one node, without those below it."""
        check_no_text(element, self._findings)
        if element.attributes.get("name") == "":
            self._note(element, "attribute 'name' is empty", "name")
        if element.tag == NodeKind.SUBTREE.value:
            self._check_subtree(element)
            return
        node = self._find_node(element)
        if node is None:
            return
        self._check_children(element, node.min_children, node.max_children)
        self._check_ports(element, node)

    def _find_node(self, element: Element) -> type[Node] | None:
        node_id = node_id_of(element)
        if not node_id:
            self._note(element, f"<{element.tag}> needs an attribute 'ID'")
            return None
        if node_id not in self._registry:
            attribute = "ID" if element.tag in KIND_TAGS else ""
            if node_id in self._document.trees:
                hint = f'; it is a tree of this file: write <SubTree ID="{node_id}"/>'
            else:
                hint = did_you_mean(node_id, self._registry)
                hint += "".join(f"; not loaded: {fault}" for fault in self._registry.faults)
            self._note(element, f"unknown node '{node_id}'{hint}", attribute)
            return None
        node = self._registry[node_id]
        if element.tag in KIND_TAGS and element.tag != node.kind.value:
            self._note(
                element, f"'{node_id}' is of kind {node.kind.value}, not {element.tag}", "ID"
            )
        elif element.tag not in KIND_TAGS and "ID" in element.attributes:
            self._note(element, "unknown attribute 'ID': the tag says which node it is", "ID")
        return node

    def _check_children(self, element: Element, min_count: int, max_count: int | None) -> None:
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
        self._note(element, f"needs {needed}, has {count}")

    # --- ports ------------------------------------------------------------------------------------

    def _check_ports(self, element: Element, node: type[Node]) -> None:
        given: dict[str, object] = {}
        for name, text in node_attributes(element).items():
            if name in CONDITION_ATTRIBUTES:
                self._check_condition(element, name, text)
            else:
                given[name] = text
        bound, wrong = bind_ports(node.ports, given, CONDITION_ATTRIBUTES)
        for name, message in wrong.items():
            self._note(element, message, name)
        for port in node.ports:
            value = bound.get(port.name)
            if isinstance(value, Reference) and value.on_board:
                self._check_board_reference(element, port, value)
            elif port.check is parse_script and isinstance(value, str):
                self._check_script_names(element, port.name, value)

    def _check_condition(self, element: Element, name: str, text: str) -> None:
        message = check_condition(text)
        if message is not None:
            self._note(element, f"attribute '{name}': {message}", name)
        else:
            self._check_script_names(element, name, text)

    def _check_script_names(self, element: Element, attribute: str, text: str) -> None:
        for part in parse_script(text).walk():
            if not isinstance(part, Name) or not part.name.startswith("@"):
                continue
            key = self._board_keys.get(part.name[1:])
            if key is None:
                message = self._no_key(part.name[1:])
            elif not issubclass(key.type, (int, float, str)):
                message = f"board key '{key.name}' holds {key.type.__name__}, no number and no text"
            else:
                continue
            self._note(element, f"attribute '{attribute}': {message}", attribute)

    def _check_board_reference(self, element: Element, port: Port[Any], at: Reference) -> None:
        key = self._board_keys.get(at.key)
        if key is None:
            self._note(element, f"attribute '{port.name}': {self._no_key(at.key)}", port.name)
        elif not key_fits(port, key):
            self._note(
                element,
                f"attribute '{port.name}' takes {port.type.__name__}, "
                f"but board key '{at.key}' holds {key.type.__name__}",
                port.name,
            )

    def _no_key(self, key: str) -> str:
        return f"the board has no key '{key}'{did_you_mean(key, self._board_keys)}"

    # --- subtrees ---------------------------------------------------------------------------------

    def _check_subtree(self, element: Element) -> None:
        self._check_children(element, 0, 0)
        trees = self._document.trees
        tree_id = element.attributes.get("ID", "")
        if not tree_id:
            self._note(element, "attribute 'ID' is missing")
        elif tree_id not in trees:
            self._note(element, f"there is no tree '{tree_id}'{did_you_mean(tree_id, trees)}", "ID")
        if "_autoremap" in element.attributes:
            try:
                SubTree.AUTOREMAP.convert(element.attributes["_autoremap"])
            except ValueError as error:
                self._note(element, f"attribute '_autoremap': {error}", "_autoremap")
        described = self._document.subtree_ports.get(tree_id)
        for name, text in node_attributes(element).items():
            self._check_entry(element, name, text, described)
        if described is not None and not autoremaps(element):
            self._check_missing_entries(element, described)

    def _check_missing_entries(self, element: Element, described: dict[str, str | None]) -> None:
        for name, default in described.items():
            if default is None and name not in element.attributes:
                self._note(
                    element,
                    f"entry '{name}' is missing: the tree is described with it, without a default",
                )

    def _check_entry(
        self, element: Element, name: str, text: str, described: dict[str, str | None] | None
    ) -> None:
        if name in CONDITION_ATTRIBUTES:
            self._check_condition(element, name, text)
            return
        if name.startswith("_"):
            hint = did_you_mean(name, CONDITION_ATTRIBUTES)
            self._note(element, f"unknown attribute '{name}'{hint}", name)
            return
        if not _VARIABLE.fullmatch(name):
            self._note(element, f"'{name}' cannot be a variable's name", name)
        elif described is not None and name not in described:
            hint = did_you_mean(name, described)
            self._note(element, f"the tree has no port '{name}'{hint}", name)
        try:
            reference = parse_reference(text, name)
        except ValueError as error:
            self._note(element, f"attribute '{name}': {error}", name)
            return
        if reference is not None and reference.on_board and reference.key not in self._board_keys:
            self._note(element, f"attribute '{name}': {self._no_key(reference.key)}", name)

    def _check_recursion(self) -> None:
        uses = {
            tree_id: [node for node in walk(tree) if node.tag == NodeKind.SUBTREE.value]
            for tree_id, tree in self._document.trees.items()
        }
        done: set[str] = set()
        for tree_id in self._document.trees:
            if tree_id not in done:
                self._follow(tree_id, uses, done)

    def _follow(self, start: str, uses: Mapping[str, list[Element]], done: set[str]) -> None:
        # Depth first, with a stack of its own: a chain of trees can be longer than Python's.
        chain = {start: iter(uses[start])}
        while chain:
            tree_id = next(reversed(chain))
            node = next(chain[tree_id], None)
            if node is None:
                del chain[tree_id]
                done.add(tree_id)
                continue
            inner = node.attributes.get("ID", "")
            if inner in chain:
                names = [*chain]
                loop = " > ".join([*names[names.index(inner) :], inner])
                self._note(node, f"the tree contains itself: {loop}", "ID")
            elif inner not in done and inner in uses:
                chain[inner] = iter(uses[inner])
