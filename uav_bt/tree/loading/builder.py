"""From checked elements to nodes: subtrees put in place, overrides applied, everything bounded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from uav_bt.board import Key
from uav_bt.errors import TreeError, UnknownNameError, ValueRangeError, did_you_mean
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.checker import Checker
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import node_id_of
from uav_bt.tree.loading.findings import Finding, Findings, Position, errors_of
from uav_bt.tree.loading.palette import PalettePort
from uav_bt.tree.loading.rules import Rule
from uav_bt.tree.loading.source import MAX_DEPTH, MAX_NODES, Element
from uav_bt.tree.mission_tree import Place, child_paths
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import parse_reference
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.scripted import ScriptedLeaf, mock_class

POLICY_PORT: Final = "policy"  # by this name a leaf declares the port that names its leaf policy
_FIXED: Final = frozenset({"ID", "_autoremap", "name"})  # these say which nodes there are


@dataclass
class _Plan:
    """A node to be made."""

    element: Element
    name: str
    path: str
    attributes: dict[str, str]
    children: list[_Plan]
    mock: str | None = None  # the script of the leaf that takes its place

    def walk(self) -> Iterator[_Plan]:
        yield self
        for child in self.children:
            yield from child.walk()


class _TooLargeError(Exception):
    pass


class Builder:
    """Makes the nodes of a document's main tree.

    Args:
        document: the file's outline.
        registry: the nodes that may occur.
        findings: where they are added.
    """

    def __init__(self, document: Document, registry: NodeRegistry, findings: Findings) -> None:
        self._document = document
        self._registry = registry
        self._findings = findings
        self._count = 0
        self.places: dict[str, Place] = {}  # of the nodes, by path; filled by `build`
        self.replaced: dict[str, dict[str, str]] = {}  # attributes by path; filled by `build`

    def build(
        self,
        overrides: Mapping[str, Mapping[str, str]],
        *,
        by_key: Mapping[Key[Any], Mapping[str, str]],
        mocks: Mapping[str, str],
    ) -> Node:
        """Return the root node.

        Args:
            overrides: attribute values by node, which is named by its name or its path.
            by_key: attribute values by board key, for the leaves that write it and have the port.
            mocks: scripts by leaf, which is named by its path, its name or its node's id.

        Raises:
            TreeError: the tree grows too large, an override or a mock does not fit, or a leaf
                names a policy that is not registered.
        """
        main = self._document.trees[self._document.main]
        root = main.children[0]
        name = _name_of(root)
        try:
            plan = self._plan(root, name, f"{self._document.main}/{name}", depth=1)
        except _TooLargeError as error:
            finding = Finding(str(main.path), main.position, str(error), main.label)
            raise TreeError(self._document.path, [finding]) from error
        plans = list(plan.walk())
        self._apply_by_key(by_key, plans)
        self._apply(overrides, plans)
        self._mock(mocks, plans)
        self._check_policies(plans)
        self._findings.raise_any(self._document.path)
        return self._make(plan)

    def _plan(self, element: Element, name: str, path: str, *, depth: int) -> _Plan:
        self._count += 1
        if self._count > MAX_NODES:
            raise _TooLargeError(f"more than {MAX_NODES} nodes once its subtrees are in place")
        if depth > MAX_DEPTH:
            raise _TooLargeError(f"deeper than {MAX_DEPTH} once its subtrees are in place")
        inner = element.children
        if element.tag == NodeKind.SUBTREE.value:
            inner = self._document.trees[element.attributes["ID"]].children
        names = [_name_of(child) for child in inner]
        children = [
            self._plan(child, child_name, child_path, depth=depth + 1)
            for child, child_name, child_path in zip(
                inner, names, child_paths(path, names), strict=True
            )
        ]
        return _Plan(element, name, path, self._document.entries(element), children)

    def _apply_by_key(
        self, by_key: Mapping[Key[Any], Mapping[str, str]], plans: list[_Plan]
    ) -> None:
        for plan in plans if by_key else ():
            leaf = self._leaf_class(plan)
            taken = leaf.values_taken(by_key) if leaf is not None else {}
            if taken:
                self._replace(plan, taken)
                self._check_override(_id_of(plan), taken, plan)

    def _apply(self, overrides: Mapping[str, Mapping[str, str]], plans: list[_Plan]) -> None:
        for target, attributes in overrides.items():
            hits = [plan for plan in plans if target in (plan.name, plan.path)]
            if not hits:
                hint = did_you_mean(target, {plan.name for plan in plans})
                self._findings.add(
                    self._document.path,
                    Position(1, 1),
                    f"override of '{target}': the tree has no node of that name or path{hint}",
                )
            for plan in hits:
                self._replace(plan, attributes)
                self._check_override(target, attributes, plan)

    def _replace(self, plan: _Plan, attributes: Mapping[str, str]) -> None:
        plan.attributes.update(attributes)
        self.replaced.setdefault(plan.path, {}).update(attributes)

    def _check_override(self, target: str, attributes: Mapping[str, str], plan: _Plan) -> None:
        element, lead = plan.element, f"override of '{target}': "
        for name in _FIXED.intersection(attributes):
            self._findings.note(element, f"{lead}'{name}' cannot be replaced")
        for name in attributes:
            if name.startswith("_") and name not in CONDITION_ATTRIBUTES | _FIXED:
                hint = did_you_mean(name, CONDITION_ATTRIBUTES)
                self._findings.note(element, f"{lead}unknown attribute '{name}'{hint}")
        # The file itself is good by now, so whatever is found comes from the override.
        found = Findings()
        replaced = {**element.attributes, **attributes}
        Checker(self._document, self._registry, found).check_element(
            replace(element, attributes=replaced)
        )
        for finding in errors_of(found):
            self._findings.add(
                finding.path, finding.position, f"{lead}{finding.message}", finding.node
            )

    def _mock(self, mocks: Mapping[str, str], plans: list[_Plan]) -> None:
        if not mocks:
            return
        classes = {plan.path: leaf for plan in plans if (leaf := self._leaf_class(plan))}
        leaves = [plan for plan in plans if plan.path in classes]
        for names in (_id_of, lambda plan: plan.name, lambda plan: plan.path):
            # The most exact name of a leaf comes last, and so is the one that counts.
            for plan in leaves:
                plan.mock = mocks.get(names(plan), plan.mock)
        named: dict[str, list[_Plan]] = {}
        for plan in leaves:
            for name in set(_names(plan)):
                named.setdefault(name, []).append(plan)
        for target, script in mocks.items():
            hits = named.get(target, [])
            for plan in hits:
                self._check_mock(target, script, plan, mock_class(classes[plan.path]))
            if not hits:
                self._findings.add(
                    self._document.path, Position(1, 1), _no_such_leaf(target, plans, leaves)
                )

    def _check_policies(self, plans: list[_Plan]) -> None:
        """Refuse names of policies that are not registered; one in a variable shows in flight."""
        known = self._registry.policies
        if known is None:
            return
        for plan in plans:
            leaf = self._leaf_class(plan)
            ports = leaf.ports if leaf else ()
            port = next((port for port in ports if port.name == POLICY_PORT), None)
            if port is None or plan.mock is not None or isinstance(port, PalettePort):
                continue
            name = str(plan.attributes.get(POLICY_PORT, port.default))
            registered = name.partition(":")[0]  # what follows is the policy's own business
            if parse_reference(name, POLICY_PORT) is None and registered not in known:
                message = str(UnknownNameError("policy", registered, known))
                where = plan.element.at(POLICY_PORT)
                self._findings.add(
                    plan.element.path, where, message, plan.path, rule=Rule.NOT_INSTALLED
                )

    def _leaf_class(self, plan: _Plan) -> type[Leaf] | None:
        if plan.element.tag == NodeKind.SUBTREE.value:
            return None
        node = self._registry[node_id_of(plan.element)]
        return node if issubclass(node, Leaf) else None

    def _check_mock(self, target: str, script: str, plan: _Plan, leaf: type[ScriptedLeaf]) -> None:
        try:
            leaf.check_script(script)
        except ValueRangeError as error:
            self._findings.note(plan.element, f"mock of '{target}': {error}")

    def _make(self, plan: _Plan) -> Node:
        self.places[plan.path] = Place(plan.element.path, plan.element.position)
        children = [self._make(child) for child in plan.children]
        given: dict[str, object] = dict(plan.attributes)
        if plan.element.tag == NodeKind.SUBTREE.value:
            autoremap = SubTree.AUTOREMAP.convert(plan.element.attributes.get("_autoremap", False))
            conditions = {
                key: given.pop(key) for key in plan.attributes if key in CONDITION_ATTRIBUTES
            }
            entries = {key: str(text) for key, text in given.items()}
            return SubTree(
                plan.name,
                children[0],
                entries,
                autoremap=autoremap,
                tree_id=plan.element.attributes["ID"],
                **conditions,
            )
        node = self._registry[node_id_of(plan.element)]
        if issubclass(node, ControlNode):
            return node(plan.name, children, **given)
        if issubclass(node, DecoratorNode):
            return node(plan.name, children[0], **given)
        if plan.mock is not None and issubclass(node, Leaf):
            return mock_class(node)(plan.name, plan.mock, **given)
        return node(plan.name, **given)


def _name_of(element: Element) -> str:
    name = element.attributes.get("name")
    if name:
        return name
    if element.tag == NodeKind.SUBTREE.value:
        return element.attributes["ID"]
    return node_id_of(element)


def _id_of(plan: _Plan) -> str:
    return node_id_of(plan.element)


def _names(plan: _Plan) -> tuple[str, str, str]:
    return plan.path, plan.name, _id_of(plan)


def _no_such_leaf(target: str, plans: list[_Plan], leaves: list[_Plan]) -> str:
    for plan in plans:
        if target in (plan.path, plan.name) or target == plan.element.tag:
            return f"mock of '{target}': only leaves can be mocked, this is a {plan.element.tag}"
    known = {name for plan in leaves for name in _names(plan)}
    return (
        f"mock of '{target}': the tree has no leaf of that path, name or node id"
        f"{did_you_mean(target, known)}"
    )
