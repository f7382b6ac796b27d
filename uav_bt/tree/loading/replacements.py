"""Values that callers give to nodes instead of those of the file, and mocks in place of leaves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from uav_bt.board import Key
from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import Attributes
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, Findings, Position, Rule
from uav_bt.tree.loading.parameters import SET, split_port
from uav_bt.tree.loading.places import takes_places
from uav_bt.tree.loading.source import Element
from uav_bt.tree.mission_tree import MissionTree, Place
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES, SubTree
from uav_bt.tree.scripted import (
    ALL_LEAVES,
    Mock,
    ScriptedLeaf,
    mock_class,
    subtree_mock,
    undeclared_answers,
)

_MAX_PATHS: Final = 6  # in a message, of nodes that a name fits
_FIXED: Final = frozenset({"ID", "name"})  # these say which nodes there are


class Part(NamedTuple):
    """What a node was made of."""

    element: Element
    given: dict[str, str]  # texts of attributes: those of the file, defaults of entries, others


class Replacements:
    """Overrides, parameters and mocks of a tree."""

    def __init__(
        self,
        document: Document,
        findings: Findings,
        overrides: Mapping[str, Mapping[str, str]] | None = None,
        by_key: Mapping[Key[Any], Mapping[str, str]] | None = None,
        mocks: Mapping[str, str | Mock] | None = None,
    ) -> None:
        self._document = document
        self._findings = findings
        self._overrides = overrides or {}
        self._by_key = by_key or {}
        given = {
            name: Mock(one) if isinstance(one, str) else one for name, one in (mocks or {}).items()
        }
        self._others = given.pop(ALL_LEAVES, None)
        self._mocks = given
        self._names: set[str] = set()  # of leaves and SubTrees
        self._nodes: set[str] = set()  # names of others

    # --- mocks ------------------------------------------------------------------------------------

    def mock(
        self, node: type[Node], element: Element, name: str, path: str, entries: Iterable[str]
    ) -> tuple[type[ScriptedLeaf], Mock] | None:
        """Return the class of the leaf that takes the place of a node, and its mock."""
        is_leaf = issubclass(node, Leaf)
        tree_id = element.attributes.get("ID", "")
        names = (path, name, tree_id if issubclass(node, SubTree) else node.node_id)
        if not (is_leaf or issubclass(node, SubTree)):
            self._nodes.update((*names, element.tag))
            return None
        self._names.update(names)
        mock: Mock | None = None
        for one in reversed(names):  # the most exact selector comes last and counts
            if one in self._mocks:
                mock = self._mocks[one].over(mock)
        is_ours = is_leaf and node not in BUILTIN_NODES
        if is_ours and self._others is not None:
            mock = self._others if mock is None else mock.over(self._others)
        if mock is None:
            return None
        target = next((one for one in names if one in self._mocks), ALL_LEAVES)
        stand_in = mock_class(node) if issubclass(node, Leaf) else subtree_mock(tree_id, entries)
        message = None
        try:
            stand_in.check(mock)
            if is_ours and issubclass(node, Leaf) and target != ALL_LEAVES:
                message = undeclared_answers(node, mock)
        except ValueRangeError as error:
            message = str(error)
        if message is not None:
            place = mock.place or Place(element.path, element.position)
            self._refuse(f"mock of '{target}': {message}", place, element.label)
            return stand_in, Mock("S")
        return stand_in, mock

    def check_mocks(self) -> None:
        """Refuse mocks of nodes that the tree does not have, or that cannot be mocked."""
        for target, mock in self._mocks.items():
            if target in self._names:
                continue
            why = "the tree has no leaf of that path, name or node id"
            why += did_you_mean(target, self._names)
            if target in self._nodes:
                why = "only leaves and SubTrees can be mocked"
            self._refuse(f"mock of '{target}': {why}", mock.place)

    # --- values -----------------------------------------------------------------------------------

    def replace(self, tree: MissionTree, parts: Mapping[str, Part], attributes: Attributes) -> None:
        """Give the nodes of a tree their values from outside, and note those that do not fit."""
        values = _Values(tree, parts, attributes, self._document, self._findings)
        for leaf in tree.leaves():
            values.give(leaf, leaf.values_taken(self._by_key), leaf.node_id, None)
        chosen = set[tuple[str, str]]()
        for target, given in self._overrides.items():
            hits = [node for node in tree.nodes() if target in (node.path, node.name)]
            if not hits:
                self._refuse(f"override of '{target}': {_nowhere(tree, target)}")
            for node in hits:
                values.give(node, given, target, None)
                chosen |= {(node.path, name) for name in given}
        parameters = self._document.parameters
        for name, text in parameters.ports.items():
            place = parameters.places.get((SET, name))
            target, port = split_port(name)
            hits = [node for node in tree.nodes() if target in (node.path, node.name)]
            if not hits:
                self._refuse(f"override of '{name}': {_nowhere(tree, target)}", place)
            elif any((node.path, port) in chosen for node in hits):
                message = f"port '{name}' is given two values: leave one of them out"
                self._refuse(message, place)
            elif len(hits) > 1:
                self._refuse(_choice(name, port, [node.path for node in hits]), place)
            else:
                values.give(hits[0], {port: text}, name, place)
                chosen.add((hits[0].path, port))

    def _refuse(self, message: str, place: Place | None = None, label: str = "") -> None:
        at = place or Place(self._document.path, Position(1, 1))
        self._findings.add(at.path, at.position, message, label)


class _Values:
    """Gives values to nodes of a tree, and notes those that no file could have had."""

    def __init__(
        self,
        tree: MissionTree,
        parts: Mapping[str, Part],
        attributes: Attributes,
        document: Document,
        findings: Findings,
    ) -> None:
        self._tree = tree
        self._parts = parts
        self._attributes = attributes
        self._document = document
        self._findings = findings

    def give(self, node: Node, given: Mapping[str, str], target: str, place: Place | None) -> None:
        """Replace attributes of a node; messages name the target, and stand at the place."""
        if not given:
            return
        part, is_good = self._parts[node.path], True

        def note(
            message: str, attribute: str, rule: Rule = Rule.ATTRIBUTE, severity: str = ERROR
        ) -> None:
            nonlocal is_good
            del rule  # it is the caller's value, not the file's
            if severity == ERROR:
                is_good = False
                at = place or Place(part.element.path, part.element.at(attribute))
                message = f"override of '{target}': {message}"
                self._findings.add(at.path, at.position, message, part.element.label)

        texts = {name: self._with_places(node, name, given[name], place) for name in given}
        fixed = [name for name in texts if name in _FIXED or name.startswith("_")]
        for name in fixed:
            note(f"'{name}' cannot be replaced", name)
        if isinstance(node, SubTree):
            described = self._document.subtree_ports.get(node.tree_id) or {}
            known = {*described, *part.element.attributes}
            for name in texts.keys() - known:
                note(f"the tree has no port '{name}'{did_you_mean(name, known)}", name)
            self._attributes.entries(texts, note)
        elif not fixed:
            ports = node.ports_over(len(node.children))
            taken = [port for port in ports if port.name in texts]
            self._attributes.bound(taken if len(taken) == len(texts) else ports, texts, note)
        if is_good:
            part.given.update(texts)
            node.rebind(texts)
            self._tree.replaced.setdefault(node.path, {}).update(texts)

    def _with_places(self, node: Node, port: str, text: str, place: Place | None) -> str:
        """Return a value with the places of the files that it names."""
        document = self._document
        if not takes_places(self._parts[node.path].element, port, document.registry):
            return text
        at = place or Place(document.path, Position(1, 1))
        what = f"port '{node.name}.{port}'"
        return document.place_lists.in_text(text, document.path, at, what)


def _nowhere(tree: MissionTree, target: str) -> str:
    hint = did_you_mean(target, {node.name for node in tree.nodes()})
    return f"the tree has no node of that name or path{hint}"


def _choice(name: str, port: str, found: list[str]) -> str:
    """Return the message that a name fits several nodes."""
    paths = [f"'{path}.{port}'" for path in found]
    more = f" and {len(paths) - _MAX_PATHS} more" if len(paths) > _MAX_PATHS else ""
    return (
        f"'{name}' fits {len(found)} nodes: name one by its path, such as "
        f"{', '.join(paths[:_MAX_PATHS])}{more}"
    )
