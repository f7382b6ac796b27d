"""Builder: checks the elements of a tree and makes its nodes, with subtrees in place, in one pass.

What is unknown or wrong becomes a placeholder, so that all findings come at once. A tree with a
placeholder is never ticked: its file has an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from uav_bt.errors import InputError, did_you_mean
from uav_bt.tree.loading.attributes import Attributes, Note
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.elements import (
    check_no_text,
    check_private_attributes,
    node_attributes,
    node_id_of,
)
from uav_bt.tree.loading.findings import ERROR, WHOLE_FILE, Findings, Rule
from uav_bt.tree.loading.replacements import Made, Replacement, Replacements
from uav_bt.tree.loading.source import MAX_DEPTH, MAX_NODES, Element
from uav_bt.tree.loading.structure import check_names, check_subtree, node_class
from uav_bt.tree.mission_tree import MissionTree, Place, allow_depth
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.node_ports import BOUND, child_paths
from uav_bt.tree.nodes import BUILTIN_NODES, AlwaysSuccess, SubTree
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import CONDITION_ATTRIBUTES
from uav_bt.tree.scripted import Mock, ScriptedLeaf

_FIXED: Final = frozenset({"ID", "_autoremap", "name"})  # these say which nodes there are


class Placeholder(ControlNode):
    """Stands where a file is wrong; something unknown may happen there."""

    min_children = 0
    hides = True  # whether it may write any variable of its tree


@cache
def _stand_in(node: type[Node]) -> type[Placeholder]:
    """Return a class for nodes of a class whose attributes are wrong, or which are not flown."""
    body = {"node_id": node.node_id, "ports": node.ports, "hides": False}
    return type(f"Wrong{node.__name__}", (Placeholder,), body)


@dataclass
class Part:
    """What a node was made of."""

    element: Element
    given: dict[str, str]  # texts of attributes: those of the file, defaults of entries, overrides


@dataclass
class Built:
    """A tree that was made of a file."""

    tree: MissionTree
    parts: dict[str, Part]  # by path


class _Roots(Placeholder):
    hides = False  # only several roots of one tree


class _TooLargeError(Exception):
    pass


def _nowhere(
    message: str, attribute: str, rule: Rule = Rule.ATTRIBUTE, severity: str = ERROR
) -> None:
    """Take the faults of a node that is unknown as a whole."""


class Builder:
    """Makes trees of a document."""

    def __init__(
        self,
        document: Document,
        findings: Findings,
        others: Findings | None = None,
        checked: Iterable[str] = (),
    ) -> None:
        self._document = document
        self._registry = document.registry
        self._findings = findings
        self._others = findings if others is None else others
        self._is_flown = others is None
        self._checked = frozenset(checked)
        self._attributes = Attributes(document)
        self._replacements: Replacements | None = None
        self._parts: dict[str, Part] = {}
        self._count = 0
        self.entered: set[str] = set()  # trees that were built

    def build(self, tree_id: str, replacements: Replacements | None = None) -> Built | None:
        """Return a tree; None if it grows too large, which is a finding."""
        element = self._document.trees[tree_id]
        self._parts, self._count = {}, 0
        self._replacements = replacements
        allow_depth(MAX_DEPTH)
        try:
            root = self._root(tree_id, f"{tree_id}/", (), 1)
        except _TooLargeError as error:
            if self._is_flown:
                label = element.label
                self._findings.add(element.path, element.position, str(error), label)
            return None
        if replacements is not None:
            replacements.check_names()
        tree = MissionTree(root, name=tree_id)
        tree.variables.enum_members.update(self._document.enum_members)
        tree.places = {
            path: Place(one.element.path, one.element.position) for path, one in self._parts.items()
        }
        tree.replaced = {} if replacements is None else replacements.replaced
        return Built(tree, self._parts)

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
            return _Roots(tree_id, self._children(tree, lead + tree_id, chain, depth))
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
        part = self._parts[path] = Part(element, {})
        made = Made(element, node or Placeholder, _name_of(element), path)
        replaced = {} if self._replacements is None else self._replacements.of(made)
        if is_subtree:
            return self._subtree(made, replaced, chain, depth)
        children = self._children(element, path, chain, depth)
        if node is None:
            conditions = self._attributes.conditions(node_attributes(element), _nowhere)
            return Placeholder(made.name, children, **conditions)
        part.given = node_attributes(element)
        note = self._note(element, chain)
        conditions = self._attributes.conditions(part.given, note)
        ports = node.ports_over(len(children))
        values = {name: part.given[name] for name in part.given.keys() - CONDITION_ATTRIBUTES}
        bound = self._attributes.bound(ports, values, note)
        if replaced:
            part.given |= {name: one.text for name, one in replaced.items()}
            self._check_fixed(made, replaced)
            over = self._replacing(made, replaced)
            texts = {name: one.text for name, one in replaced.items()}
            conditions |= self._attributes.conditions(texts, over)
            for name in [*texts]:
                if name.startswith("_") or name in _FIXED:
                    del texts[name]
            taken = [port for port in ports if port.name in texts]
            is_known = len(taken) == len(texts)
            again = self._attributes.bound(taken if is_known else ports, texts, over)
            bound = None if bound is None or again is None else {**bound, **again}
        stand_in = self._mock(made, ())
        if stand_in is not None:
            return stand_in[0](made.name, stand_in[1], **{BOUND: bound or {}}, **conditions)
        return self._node(made, children, bound, conditions)

    def _mock(self, made: Made, entries: Iterable[str]) -> tuple[type[ScriptedLeaf], Mock] | None:
        return None if self._replacements is None else self._replacements.mock(made, entries)

    def _node(
        self,
        made: Made,
        children: list[Node],
        bound: dict[str, Any] | None,
        conditions: dict[str, str],
    ) -> Node:
        node = made.node
        given: dict[str, Any] = {**conditions, BOUND: bound or {}}
        if node not in BUILTIN_NODES and (bound is None or not self._is_flown):
            return _stand_in(node)(made.name, children, **given)
        try:
            if issubclass(node, ControlNode):
                return node(made.name, children, **given)
            if issubclass(node, DecoratorNode):
                if len(children) > 1:
                    return _stand_in(node)(made.name, children, **given)
                return node(made.name, *(children or [AlwaysSuccess()]), **given)
            return node(made.name, **given)
        except InputError as error:
            self._findings.add(self._document.path, WHOLE_FILE, str(error))
            return Placeholder(made.name, children)

    # --- subtrees ---------------------------------------------------------------------------------

    def _subtree(
        self,
        made: Made,
        replaced: Mapping[str, Replacement],
        chain: tuple[str, ...],
        depth: int,
    ) -> Node:
        element, path = made.element, made.path
        check_subtree(element, self._registry, self._findings)
        for child in element.children:  # they are checked, and have no place
            self._make(child, f"{path}/", chain, depth + 1)
            self._parts.pop(f"{path}/")
        tree_id = element.attributes.get("ID", "")
        part, note = self._parts[path], self._note(element, chain)
        part.given = given = self._document.entries(element)
        self._check_subtree(element, tree_id, note)
        conditions = self._attributes.conditions(given, note)
        entries = self._attributes.entries(given, note)
        if replaced:
            self._check_fixed(made, replaced)
            texts = {name: one.text for name, one in replaced.items()}
            part.given |= texts
            over = self._replacing(made, replaced)
            conditions |= self._attributes.conditions(texts, over)
            texts = {name: text for name, text in texts.items() if not name.startswith("_")}
            entries |= self._attributes.entries(texts, over)
        before = dict(self._parts)
        root = self._root(tree_id, f"{path}/", chain, depth + 1)
        stand_in = self._mock(made, entries)
        if stand_in is not None:
            self._parts = before
            return stand_in[0](made.name, stand_in[1], **entries, **conditions)
        autoremap = autoremaps(element)
        return SubTree(made.name, root, entries, autoremap=autoremap, tree_id=tree_id, **conditions)

    def _check_subtree(self, element: Element, tree_id: str, note: Note) -> None:
        document = self._document
        if tree_id and tree_id not in document.trees and tree_id not in self._registry:
            hint = did_you_mean(tree_id, [*document.trees, *document.elsewhere]) + document.unread
            hint = hint or "; --trees DIR adds the trees of a folder"
            note(f"there is no tree '{tree_id}'{hint}", "ID", Rule.UNKNOWN_TREE)
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

    # --- findings ---------------------------------------------------------------------------------

    def _note(self, element: Element, chain: tuple[str, ...]) -> Note:
        findings = Findings() if chain[-1] in self._checked else self._others

        def note(
            message: str, attribute: str, rule: Rule = Rule.ATTRIBUTE, severity: str = ERROR
        ) -> None:
            findings.note(element, message, attribute, rule=rule, severity=severity)

        return note

    def _replacing(self, made: Made, replaced: Mapping[str, Replacement]) -> Note:
        """Return what takes the faults of values from outside; their warnings are left out."""

        def note(
            message: str, attribute: str, rule: Rule = Rule.ATTRIBUTE, severity: str = ERROR
        ) -> None:
            del rule  # it is the caller's value, not the file's
            if severity == ERROR and attribute in replaced:
                _, lead, place = replaced[attribute]
                at = place or Place(made.element.path, made.element.at(attribute))
                label = made.element.label
                self._findings.add(at.path, at.position, f"{lead}{message}", label)

        return note

    def _check_fixed(self, made: Made, replaced: Mapping[str, Replacement]) -> None:
        """Refuse replacements that no file could have had."""
        element = made.element
        described = self._document.subtree_ports.get(element.attributes.get("ID", "")) or {}
        known = {*described, *element.attributes}
        note = self._replacing(made, replaced)
        for name in replaced:
            if name in _FIXED:
                note(f"'{name}' cannot be replaced", name)
            elif name.startswith("_") and name not in CONDITION_ATTRIBUTES:
                note(f"unknown attribute '{name}'{did_you_mean(name, CONDITION_ATTRIBUTES)}", name)
            elif made.node is SubTree and not name.startswith("_") and name not in known:
                note(f"the tree has no port '{name}'{did_you_mean(name, known)}", name)


def _name_of(element: Element) -> str:
    """Return the name of a node: its attribute `name`, or else the id of the node or tree."""
    is_subtree = element.tag == NodeKind.SUBTREE.value
    node_id = element.attributes.get("ID", "") if is_subtree else node_id_of(element)
    return element.attributes.get("name") or node_id or element.tag
