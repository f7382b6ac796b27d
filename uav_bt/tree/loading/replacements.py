"""Values that callers give to nodes instead of those of the file, and mocks in place of leaves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

from uav_bt.board import Key
from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.attributes import Attributes
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import ERROR, Findings, Position, Rule
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.parameters import SET, Parameters, split_port
from uav_bt.tree.loading.places import PlaceLists, takes_places
from uav_bt.tree.loading.source import Element
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.mission_tree import MissionTree, Place
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES, SubTree
from uav_bt.tree.registry import NodeRegistry
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
    is_good: bool = True  # whether the file's own values were taken


@dataclass(frozen=True, eq=False)
class Built:
    """A tree that was made of a file."""

    tree: MissionTree
    parts: dict[str, Part]  # by path

    @cached_property
    def uses(self) -> Uses:
        """What writes and reads its variables, once the tree has its values."""
        return Uses(self.tree)


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
        self._attributes = Attributes(document)
        self._overrides = overrides or {}
        self._by_key = by_key or {}
        given = {
            name: Mock(one) if isinstance(one, str) else one for name, one in (mocks or {}).items()
        }
        self._others = given.pop(ALL_LEAVES, None)
        self._mocks = given
        self._names: set[str] = set()  # of nodes that can be mocked
        self._made: set[str] = set()  # names and paths of all nodes, those below mocks included

    # --- mocks ------------------------------------------------------------------------------------

    def mock(
        self, node: type[Node], element: Element, name: str, path: str, entries: Iterable[str]
    ) -> tuple[type[ScriptedLeaf], Mock] | None:
        """Return the class of the leaf that takes the place of a node, and its mock."""
        self._made |= {path, name}
        if not issubclass(node, (Leaf, SubTree)):
            return None
        kind = node.node_id if issubclass(node, Leaf) else element.attributes.get("ID", "")
        names = [one for one in (path, name, kind) if one in self._mocks]  # the most exact first
        self._names |= {path, name, kind}
        mocks = [self._mocks[one] for one in names]
        is_ours = issubclass(node, Leaf) and node not in BUILTIN_NODES
        if is_ours and self._others is not None:
            mocks.append(self._others)
        if not mocks:
            return None
        mock = mocks.pop()
        while mocks:
            mock = mocks.pop().over(mock)
        stand_in = mock_class(node) if issubclass(node, Leaf) else subtree_mock(kind, entries)
        message = None
        try:
            stand_in.check(mock)
            if is_ours and issubclass(node, Leaf) and names:
                message = undeclared_answers(node, mock)
        except ValueRangeError as error:
            message = str(error)
        if message is None:
            return stand_in, mock
        place = mock.place or Place(element.path, element.position)
        self._refuse(f"mock of '{(*names, ALL_LEAVES)[0]}': {message}", place, element.label)
        return stand_in, Mock("S")

    # --- values -----------------------------------------------------------------------------------

    def replace(self, built: Built) -> None:
        """Give the nodes of a tree their values from outside, and note what does not fit."""
        for target in self._mocks.keys() - self._names:
            hint = did_you_mean(target, self._names)
            what = f"the tree has no leaf or SubTree of that path, name or node id{hint}"
            self._refuse(f"mock of '{target}': {what}", self._mocks[target].place)
        for leaf in built.tree.leaves():
            self._give(built, leaf, leaf.values_taken(self._by_key), leaf.node_id, None)
        chosen = set[tuple[str, str]]()
        for target, given in self._overrides.items():
            for node in self._hits(built, target, given, target, None):
                self._give(built, node, given, target, None)
                chosen |= {(node.path, name) for name in given}
        parameters = self._document.parameters
        for name, text in parameters.ports.items():
            place, (target, port) = parameters.places.get((SET, name)), split_port(name)
            hits = self._hits(built, target, (port,), name, place)
            if any((node.path, port) in chosen for node in hits):
                message = f"port '{name}' is given two values: leave one of them out"
                self._refuse(message, place)
            elif len(hits) > 1:
                self._refuse(_choice(name, port, [node.path for node in hits]), place)
            elif hits:
                self._give(built, hits[0], {port: text}, name, place)
                chosen.add((hits[0].path, port))

    def _hits(
        self, built: Built, target: str, ports: Iterable[str], what: str, place: Place | None
    ) -> list[Node]:
        """Return the nodes of a path or name; refuse one that no node has."""
        nodes = [node for node in built.tree.nodes() if node.path in built.parts]
        hits = [node for node in nodes if target in (node.path, node.name)]
        if not hits and target not in self._made:
            hint = did_you_mean(target, {node.name for node in nodes})
            hint += "".join(self._having(built, port) for port in ports)
            message = f"the tree has no node of that name or path{hint}"
            self._refuse(f"override of '{what}': {message}", place)
        return hits

    def _give(
        self, built: Built, node: Node, given: Mapping[str, str], what: str, place: Place | None
    ) -> None:
        """Replace attributes of a node; messages name what was given, and stand at the place."""
        if not given:
            return
        part, is_good = built.parts[node.path], True

        def note(message: str, attribute: str, *, severity: str = ERROR, **_rule: Rule) -> None:
            nonlocal is_good
            if severity == ERROR:
                is_good = False
                at = place or Place(part.element.path, part.element.at(attribute))
                self._refuse(f"override of '{what}': {message}", at, part.element.label)

        texts = {name: self._with_places(part, node, name, given[name], place) for name in given}
        fixed = [name for name in texts if name in _FIXED or name.startswith("_")]
        for name in fixed:
            note(f"'{name}' cannot be replaced", name)
        if isinstance(node, SubTree) or not fixed:
            known = self._known(built, node)
            whole = "tree" if isinstance(node, SubTree) else "node"
            for name in sorted(texts.keys() - known):
                hint = did_you_mean(name, known) or self._having(built, name)
                note(f"the {whole} has no port '{name}'{hint}", name)
        if isinstance(node, SubTree):
            self._attributes.entries(texts, note)
        elif not fixed:
            ports = node.ports_over(len(node.children))
            taken = [port for port in ports if port.name in texts]
            self._attributes.bound(taken, {port.name: texts[port.name] for port in taken}, note)
        if is_good and part.is_good:
            part.given.update(texts)
            node.rebind(texts)
            built.tree.replaced.setdefault(node.path, {}).update(texts)

    def _known(self, built: Built, node: Node) -> set[str]:
        """Return the names of the ports of a node, or of the entries of a SubTree."""
        if isinstance(node, SubTree):
            described = self._document.subtree_ports.get(node.tree_id) or {}
            return {*described, *built.parts[node.path].element.attributes}
        return {port.name for port in node.ports_over(len(node.children))}

    def _having(self, built: Built, port: str) -> str:
        """Return a sentence that names the nodes with a port; empty if there are none."""
        nodes = (node for node in built.tree.nodes() if node.path in built.parts)
        names = dict.fromkeys(node.name for node in nodes if port in self._known(built, node))
        shown = ", ".join(f"'{name}.{port}'" for name in [*names][:_MAX_PATHS])
        return f"; nodes with this port: {shown}" if names else ""

    def _with_places(
        self, part: Part, node: Node, port: str, text: str, place: Place | None
    ) -> str:
        """Return a value with the places of the files that it names."""
        document = self._document
        if not takes_places(part.element, port, document.registry):
            return text
        at = place or Place(document.path, Position(1, 1))
        what = f"port '{node.name}.{port}'"
        return document.place_lists.in_text(text, document.path, at, what)

    def _refuse(self, message: str, place: Place | None = None, label: str = "") -> None:
        at = place or Place(self._document.path, Position(1, 1))
        self._findings.add(at.path, at.position, message, label)


def replace_in(
    tree: MissionTree,
    registry: NodeRegistry,
    parameters: Parameters,
    overrides: Mapping[str, Mapping[str, str]],
    by_key: Mapping[Key[Any], Mapping[str, str]],
) -> None:
    """Replace values of a tree that is made, before its setup, or raise a TreeError."""
    findings = Findings()
    places = PlaceLists({}, findings)
    document = Document(tree.path, registry, places, Lookup(), parameters=parameters)
    parts = {
        node.path: Part(
            Element(
                tree.path,
                node.node_id,
                {**(node.attributes if isinstance(node, SubTree) else {}), "name": node.name},
                Position(1, 1),
                dict,
            ),
            {},
        )
        for node in tree.nodes()
    }
    Replacements(document, findings, overrides, by_key).replace(Built(tree, parts))
    findings.raise_any(tree.path)


def _choice(name: str, port: str, found: list[str]) -> str:
    """Return the message that a name fits several nodes."""
    paths = [f"'{path}.{port}'" for path in found]
    more = f" and {len(paths) - _MAX_PATHS} more" if len(paths) > _MAX_PATHS else ""
    return (
        f"'{name}' fits {len(found)} nodes: name one by its path, such as "
        f"{', '.join(paths[:_MAX_PATHS])}{more}"
    )
