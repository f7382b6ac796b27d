"""Values that callers give to nodes instead of those of the file, and mocks in place of leaves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from uav_bt.board import Key
from uav_bt.errors import ValueRangeError, did_you_mean
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import Findings, Position
from uav_bt.tree.loading.parameters import SET, split_port
from uav_bt.tree.loading.places import takes_places
from uav_bt.tree.loading.source import Element
from uav_bt.tree.mission_tree import Place
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


class Replacement(NamedTuple):
    """A value in place of that of the file."""

    text: str
    lead: str  # how a message about it begins
    place: Place | None  # where it was written; None: in the code


class Made(NamedTuple):
    """A node that is to be made."""

    element: Element
    node: type[Node]
    name: str
    path: str

    @property
    def names(self) -> tuple[str, str, str]:
        """Names by which a caller may choose it, the most exact one first."""
        is_subtree = issubclass(self.node, SubTree)
        node_id = self.element.attributes.get("ID", "") if is_subtree else self.node.node_id
        return self.path, self.name, node_id


class Replacements:
    """Overrides, parameters and mocks of a tree that is being built."""

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
        self._ports = {name: split_port(name) for name in document.parameters.ports}
        self.replaced: dict[str, dict[str, str]] = {}  # attributes by path
        self._made: list[Made] = []

    def of(self, made: Made) -> dict[str, Replacement]:
        """Return the values of a node that replace those of the file, by attribute."""
        self._made.append(made)
        taken: dict[str, Replacement] = {}

        def take(attributes: Mapping[str, str], target: str, place: Place | None) -> None:
            for name, text in attributes.items():
                placed = self._with_places(made, name, text, place)
                taken[name] = Replacement(placed, f"override of '{target}': ", place)

        if self._by_key and issubclass(made.node, Leaf):
            take(made.node.values_taken(self._by_key), made.node.node_id, None)
        for target, attributes in self._overrides.items():
            if target in made.names[:2]:
                take(attributes, target, None)
        parameters = self._document.parameters
        for name, (target, port) in self._ports.items():
            if target in made.names[:2]:
                place = parameters.places.get((SET, name))
                take({port: parameters.ports[name]}, name, place)
        if taken:
            self.replaced[made.path] = {name: one.text for name, one in taken.items()}
        return taken

    def _with_places(self, made: Made, port: str, text: str, place: Place | None) -> str:
        """Return a value with the places of the files that it names."""
        document = self._document
        if not takes_places(made.element, port, document.registry):
            return text
        at = place or Place(document.path, Position(1, 1))
        what = f"port '{made.name}.{port}'"
        return document.place_lists.in_text(text, document.path, at, what)

    def mock(self, made: Made, entries: Iterable[str]) -> tuple[type[ScriptedLeaf], Mock] | None:
        """Return the class of the leaf that takes the place of a node, and its mock."""
        if not issubclass(made.node, (Leaf, SubTree)):
            return None
        mock: Mock | None = None
        for name in reversed(made.names):  # the most exact selector comes last and counts
            if name in self._mocks:
                mock = self._mocks[name].over(mock)
        is_ours = issubclass(made.node, Leaf) and made.node not in BUILTIN_NODES
        if is_ours and self._others is not None:
            mock = self._others if mock is None else mock.over(self._others)
        if mock is None:
            return None
        target = next((name for name in made.names if name in self._mocks), ALL_LEAVES)
        if issubclass(made.node, Leaf):
            stand_in = mock_class(made.node)
        else:
            stand_in = subtree_mock(made.names[2], entries)
        message = None
        try:
            stand_in.check(mock)
            if is_ours and issubclass(made.node, Leaf) and target != ALL_LEAVES:
                message = undeclared_answers(made.node, mock)
        except ValueRangeError as error:
            message = str(error)
        if message is not None:
            self._refuse(f"mock of '{target}': {message}", mock.place, made.element)
            return stand_in, Mock("S")
        return stand_in, mock

    # --- names that fit no node, or several -------------------------------------------------------

    def check_names(self) -> None:
        """Refuse names that fit no node, ports that fit several, and ports with two values."""
        names = {made.name for made in self._made}
        chosen: set[tuple[str, str]] = set()
        for target, attributes in self._overrides.items():
            hits = self._hits(target)
            chosen.update((made.path, attribute) for made in hits for attribute in attributes)
            if not hits:
                self._refuse(_nowhere(target, target, names), None)
        for name, (target, port) in self._ports.items():
            place = self._document.parameters.places.get((SET, name))
            hits = self._hits(target)
            twice = [made for made in hits if (made.path, port) in chosen]
            if not hits:
                self._refuse(_nowhere(name, target, names), place)
            elif twice:
                message = f"port '{name}' is given two values: leave one of them out"
                self._refuse(message, place, twice[0].element)
            elif len(hits) > 1:
                self._refuse(_choice(name, port, [made.path for made in hits]), place)
            else:
                chosen.add((hits[0].path, port))
        leaves = {
            one
            for made in self._made
            if issubclass(made.node, (Leaf, SubTree))
            for one in made.names
        }
        for target, mock in self._mocks.items():
            if target not in leaves:
                self._refuse(f"mock of '{target}': {self._no_leaf(target, leaves)}", mock.place)

    def _hits(self, target: str) -> list[Made]:
        return [made for made in self._made if target in made.names[:2]]

    def _no_leaf(self, target: str, known: set[str]) -> str:
        for made in self._made:
            tag = made.element.tag
            if target in (made.path, made.name, tag):
                return f"only leaves and SubTrees can be mocked, this is a {tag}"
        return f"the tree has no leaf of that path, name or node id{did_you_mean(target, known)}"

    def _refuse(self, message: str, place: Place | None, element: Element | None = None) -> None:
        if place is None and element is not None:
            place = Place(element.path, element.position)
        at = place or Place(self._document.path, Position(1, 1))
        label = "" if element is None else element.label
        self._findings.add(at.path, at.position, message, label)


def _nowhere(name: str, target: str, known: set[str]) -> str:
    hint = did_you_mean(target, known)
    return f"override of '{name}': the tree has no node of that name or path{hint}"


def _choice(name: str, port: str, found: list[str]) -> str:
    """Return the message that a name fits several nodes."""
    paths = [f"'{path}.{port}'" for path in found]
    more = f" and {len(paths) - _MAX_PATHS} more" if len(paths) > _MAX_PATHS else ""
    return (
        f"'{name}' fits {len(found)} nodes: name one by its path, such as "
        f"{', '.join(paths[:_MAX_PATHS])}{more}"
    )
