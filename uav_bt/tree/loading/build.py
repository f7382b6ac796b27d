"""Builder: checks the elements of a tree and makes its nodes, with subtrees in place, in one pass.

What is unknown or wrong becomes a placeholder, so that all findings come at once. A tree with a
placeholder is never ticked: its file has an error.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

from uav_bt.errors import InputError, did_you_mean
from uav_bt.tree.loading.attributes import Attributes, Note, check_names, check_subtree, node_class
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.elements import (
    check_no_text,
    check_private_attributes,
    node_attributes,
    node_id_of,
)
from uav_bt.tree.loading.findings import WHOLE_FILE, Findings, Rule
from uav_bt.tree.loading.replacements import Built, Part, Replacements
from uav_bt.tree.loading.source import MAX_DEPTH, MAX_NODES, Element
from uav_bt.tree.loading.uses import Placeholder
from uav_bt.tree.mission_tree import MissionTree, allow_depth
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.node_ports import BOUND, child_paths
from uav_bt.tree.nodes import BUILTIN_NODES, AlwaysSuccess, SubTree
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import CONDITION_ATTRIBUTES


@cache
def _stand_in(node: type[Node]) -> type[Placeholder]:
    """Return a class for nodes of a class whose attributes are wrong, or which are not flown."""
    body = {"node_id": node.node_id, "ports": node.ports, "hides": False}
    return type(f"Wrong{node.__name__}", (Placeholder,), body)


class _TooLargeError(Exception):
    pass


class Builder:
    """Makes trees of a document."""

    def __init__(
        self, document: Document, findings: Findings, others: Findings | None = None
    ) -> None:
        self._document = document
        self._registry = document.registry
        self._findings = findings
        self._others = findings if others is None else others
        self._attributes = Attributes(document)
        self._replacements = Replacements(document, findings)
        self._parts: dict[str, Part] = {}
        self._count = 0
        self.entered: set[str] = set()  # trees that were built

    def build(self, tree_id: str, replacements: Replacements | None = None) -> Built | None:
        """Return a tree; None if it grows too large, which is a finding."""
        element = self._document.trees[tree_id]
        self._parts, self._count = {}, 0
        self._replacements = replacements or Replacements(self._document, self._findings)
        allow_depth(MAX_DEPTH)
        try:
            root = self._root(tree_id, f"{tree_id}/", (), 1)
        except _TooLargeError as error:
            self._others.note(element, str(error))
            return None
        tree = MissionTree(root, name=tree_id)
        tree.variables.enum_members.update(self._document.enum_members)
        tree.places = {path: part.element for path, part in self._parts.items()}
        built = Built(tree, self._parts)
        if replacements is not None:
            replacements.replace(built)
        return built

    def _root(self, tree_id: str, lead: str, chain: tuple[str, ...], depth: int) -> Node:
        """Return the root of a tree, at the path that begins with `lead`."""
        tree = self._document.trees.get(tree_id)
        if tree is None or tree_id in chain or not tree.children:
            return Placeholder(tree_id or None)
        if tree_id not in self.entered:
            self.entered.add(tree_id)
            check_names(tree, self._findings)
        chain = (*chain, tree_id)
        if len(tree.children) > 1:
            return _stand_in(Placeholder)(
                tree_id, self._children(tree, lead + tree_id, chain, depth)
            )
        root = tree.children[0]
        return self._make(root, lead + _name_of(root), chain, depth)

    def _children(
        self, element: Element, path: str, chain: tuple[str, ...], depth: int
    ) -> list[Node]:
        paths = child_paths(path, [_name_of(child) for child in element.children])
        return [
            self._make(child, child_path, chain, depth + 1)
            for child, child_path in zip(element.children, paths, strict=True)
        ]

    def _make(self, element: Element, path: str, chain: tuple[str, ...], depth: int) -> Node:
        self._count += 1
        if self._count > MAX_NODES:
            raise _TooLargeError(f"more than {MAX_NODES} nodes once its subtrees are in place")
        if depth > MAX_DEPTH:
            raise _TooLargeError(f"deeper than {MAX_DEPTH} once its subtrees are in place")
        check_no_text(element, self._findings)
        check_private_attributes(element, self._findings)
        is_subtree = element.tag == NodeKind.SUBTREE.value
        node = SubTree if is_subtree else node_class(element, self._document, self._findings)
        if is_subtree:
            return self._subtree(element, path, chain, depth)
        given, name = node_attributes(element), _name_of(element)
        self._parts[path] = Part(element, given)
        children = self._children(element, path, chain, depth)
        if node is None:
            conditions = self._attributes.conditions(given, partial(Findings().note, element))
            return Placeholder(name, children, **conditions)
        note = self._note(element)
        conditions = self._attributes.conditions(given, note)
        texts = {key: given[key] for key in given.keys() - CONDITION_ATTRIBUTES}
        bound, is_good = self._attributes.bound(node.ports_over(len(children)), texts, note)
        self._parts[path] = Part(element, given, is_good)
        values = {**conditions, BOUND: bound}
        if (mock := self._replacements.mock(node, element, name, path, ())) is not None:
            return mock[0](name, mock[1], **values)
        is_flown = self._others is self._findings  # else nothing of a user is constructed
        if node not in BUILTIN_NODES and not (is_good and is_flown):
            node = _stand_in(node)
        return self._node(node, name, children, values)

    def _node(
        self, node: type[Node], name: str, children: list[Node], values: dict[str, Any]
    ) -> Node:
        if issubclass(node, DecoratorNode) and len(children) > 1:
            node = _stand_in(node)
        try:
            if issubclass(node, ControlNode):
                return node(name, children, **values)
            if issubclass(node, DecoratorNode):
                return node(name, *(children or [AlwaysSuccess()]), **values)
            return node(name, **values)
        except InputError as error:
            self._findings.add(self._document.path, WHOLE_FILE, str(error))
            return Placeholder(name, children)

    # --- subtrees ---------------------------------------------------------------------------------

    def _subtree(self, element: Element, path: str, chain: tuple[str, ...], depth: int) -> Node:
        check_subtree(element, self._registry, self._findings)
        for child in element.children:  # they are checked, and have no place
            self._make(child, f"{path}/", chain, depth + 1)
            self._parts.pop(f"{path}/")
        tree_id = element.attributes.get("ID", "")
        note, given = self._note(element), self._document.entries(element)
        self._parts[path] = Part(element, given)
        self._check_subtree(element, tree_id, note)
        if tree_id in chain:
            loop = " > ".join((*chain[chain.index(tree_id) :], tree_id))
            message = f"the tree contains itself: {loop}"
            self._findings.note(element, message, "ID", rule=Rule.UNKNOWN_TREE)
        conditions = self._attributes.conditions(given, note)
        entries = self._attributes.entries(given, note)
        before, name = dict(self._parts), _name_of(element)
        root = self._root(tree_id, f"{path}/", chain, depth + 1)
        if (mock := self._replacements.mock(SubTree, element, name, path, entries)) is not None:
            self._parts = before
            return mock[0](name, mock[1], **entries, **conditions)
        autoremap = autoremaps(element)
        return SubTree(name, root, entries, autoremap=autoremap, tree_id=tree_id, **conditions)

    def _check_subtree(self, element: Element, tree_id: str, note: Note) -> None:
        document = self._document
        if tree_id and tree_id not in document.trees and tree_id not in self._registry:
            hint = did_you_mean(tree_id, [*document.trees, *document.elsewhere]) + document.unread
            hint = hint or "; --trees DIR adds the trees of a folder"
            note(f"there is no tree '{tree_id}'{hint}", "ID", rule=Rule.UNKNOWN_TREE)
        try:
            SubTree.AUTOREMAP.convert(element.attributes.get("_autoremap", False))
        except ValueError as error:
            note(f"attribute '_autoremap': {error}", "_autoremap")
        described = document.subtree_ports.get(tree_id)
        if described is not None and not autoremaps(element):
            for name, default in described.items():
                if default is None and name not in element.attributes:
                    message = "is missing: the tree is described with it, without a default"
                    note(f"entry '{name}' {message}", "")

    def _note(self, element: Element) -> Note:
        return partial(self._others.note, element, rule=Rule.ATTRIBUTE)


def _name_of(element: Element) -> str:
    """Return the name of a node: its attribute `name`, or else the id of the node or tree."""
    is_subtree = element.tag == NodeKind.SUBTREE.value
    node_id = element.attributes.get("ID", "") if is_subtree else node_id_of(element)
    return element.attributes.get("name") or node_id or element.tag
