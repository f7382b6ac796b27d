"""Builder of nodes from checked elements, with subtrees in place and overrides applied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from uav_bt.board import Key
from uav_bt.errors import TreeError, UnknownNameError, ValueRangeError, did_you_mean
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import node_id_of
from uav_bt.tree.loading.findings import Finding, Findings, Position, Rule
from uav_bt.tree.loading.overrides import Overrides
from uav_bt.tree.loading.plans import GivenValue, Plan, name_of
from uav_bt.tree.loading.source import MAX_DEPTH, MAX_NODES, Element
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES, SubTree
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.placing import child_paths
from uav_bt.tree.port import Port
from uav_bt.tree.scripted import (
    ALL_LEAVES,
    Mock,
    ScriptedLeaf,
    mock_class,
    subtree_mock,
    undeclared_answers,
)

POLICY_PORT: Final = "policy"  # by this name a leaf declares the port that names its leaf policy


class _TooLargeError(Exception):
    pass


def _mock_class(plan: Plan) -> type[ScriptedLeaf]:
    if issubclass(plan.node, Leaf):
        return mock_class(plan.node)
    entries = [name for name in plan.attributes if name not in CONDITION_ATTRIBUTES]
    return subtree_mock(plan.element.attributes["ID"], entries)


class Builder:
    """Makes the nodes of a document's main tree.

    Args:
        document: the file's outline.
        findings: collects the findings.
    """

    def __init__(self, document: Document, findings: Findings) -> None:
        self._document = document
        self._registry = document.registry
        self._findings = findings
        self._count = 0
        self.places: dict[str, Place] = {}  # of the nodes, by path; filled by `build`
        self.replaced: dict[str, dict[str, str]] = {}  # attributes by path; filled by `build`
        # Values that the files give to ports of leaves; filled by `build`.
        self.given: list[tuple[Port[Any], GivenValue]] = []

    def build(
        self,
        overrides: Mapping[str, Mapping[str, str]],
        *,
        by_key: Mapping[Key[Any], Mapping[str, str]],
        mocks: Mapping[str, str | Mock],
    ) -> Node:
        """Return the root node.

        The document's parameters are applied, too.

        Args:
            overrides: attribute values by node, which is named by its name or its path.
            by_key: attribute values by board key, for the leaves that write it and have the port.
            mocks: scripts or mocks by the leaf's path, name or node id, or by `*`.

        Raises:
            TreeError: the tree grows too large, an override or a mock does not fit, or a leaf
                names a policy that is not registered.
        """
        main = self._document.trees[self._document.main]
        root = main.children[0]
        name = name_of(root)
        try:
            plan = self._plan(root, name, f"{self._document.main}/{name}", None, depth=1)
        except _TooLargeError as error:
            finding = Finding(str(main.path), main.position, str(error), main.label)
            raise TreeError(self._document.path, [finding]) from error
        plans = list(plan.walk())
        given = Overrides(self._document, self._findings, plans)
        given.take_by_key(by_key)
        given.take(overrides)
        given.take_ports(self._document.parameters)
        self.replaced = given.replaced
        self._mock(mocks, plan, plans)
        self._findings.raise_any(self._document.path)
        self.given = list(plan.given(self._document.parameters))
        self._check_policies()
        self._findings.raise_any(self._document.path)
        return self._make(plan)

    def _plan(
        self, element: Element, name: str, path: str, door: Plan | None, *, depth: int
    ) -> Plan:
        self._count += 1
        if self._count > MAX_NODES:
            raise _TooLargeError(f"more than {MAX_NODES} nodes once its subtrees are in place")
        if depth > MAX_DEPTH:
            raise _TooLargeError(f"deeper than {MAX_DEPTH} once its subtrees are in place")
        node = self._registry[node_id_of(element)]
        plan = Plan(element, node, name, path, self._document.entries(element), door)
        tree_id = element.attributes["ID"] if node is SubTree else None
        inner = element.children if tree_id is None else self._document.trees[tree_id].children
        names = [name_of(child) for child in inner]
        for child, child_name, child_path in zip(
            inner, names, child_paths(path, names), strict=True
        ):
            nearest = door if tree_id is None else plan
            made = self._plan(child, child_name, child_path, nearest, depth=depth + 1)
            plan.children.append(made)
        return plan

    def _mock(self, mocks: Mapping[str, str | Mock], root: Plan, plans: list[Plan]) -> None:
        given = {name: Mock(one) if isinstance(one, str) else one for name, one in mocks.items()}
        others = given.pop(ALL_LEAVES, None)
        leaves = [plan for plan in plans if plan.mockable is not None]
        named = {name for plan in leaves for name in plan.names} if given else set()
        for target, mock in given.items():
            if target not in named:
                self._refuse_mock(target, mock, self._no_such_leaf(target, plans, named))
        for plan in leaves if given else ():
            for name in reversed(plan.names):  # the most exact selector comes last and counts
                if name in given:
                    plan.mock = given[name].over(plan.mock)
            if plan.mock is not None and plan.mock.answers is not None:
                plan.children.clear()  # of a SubTree
        for plan in root.walk() if mocks else ():
            self._finish_mock(plan, given, others)

    def _finish_mock(self, plan: Plan, given: Mapping[str, Mock], others: Mock | None) -> None:
        is_ours = issubclass(plan.node, Leaf) and plan.node not in BUILTIN_NODES
        if is_ours and others is not None:
            plan.mock = others if plan.mock is None else plan.mock.over(others)
        if plan.mock is None or plan.mockable is None:
            return
        target = next((name for name in plan.names if name in given), ALL_LEAVES)
        message = None
        try:
            _mock_class(plan).check(plan.mock)
            if is_ours and issubclass(plan.node, Leaf) and target != ALL_LEAVES:
                message = undeclared_answers(plan.node, plan.mock)
        except ValueRangeError as error:
            message = str(error)
        if message is not None:
            self._refuse_mock(target, plan.mock, message, plan.element)

    def _refuse_mock(
        self, target: str, mock: Mock, message: str, element: Element | None = None
    ) -> None:
        place = mock.place or Place(self._document.path, Position(1, 1))
        if mock.place is None and element is not None:
            place = Place(element.path, element.position)
        label = "" if element is None else element.label
        self._findings.add(place.path, place.position, f"mock of '{target}': {message}", label)

    def _no_such_leaf(self, target: str, plans: list[Plan], known: set[str]) -> str:
        for plan in plans:
            tag = plan.element.tag
            if target in (plan.path, plan.name) or target == tag:
                return f"only leaves and SubTrees can be mocked, this is a {tag}"
        return f"the tree has no leaf of that path, name or node id{did_you_mean(target, known)}"

    def _check_policies(self) -> None:
        """Refuse names of policies that are not registered; the flight shows those it makes up."""
        known = self._registry.policies
        if known is None:
            return
        for port, value in self.given:
            name = value.text.partition(":")[0]  # what follows is the policy's own business
            if port.name == POLICY_PORT and name not in known:
                message = str(UnknownNameError("policy", name, known))
                where = value.element.at(value.attribute)
                self._findings.add(
                    value.element.path, where, message, value.path, rule=Rule.NOT_INSTALLED
                )

    def _make(self, plan: Plan) -> Node:
        self.places[plan.path] = Place(plan.element.path, plan.element.position)
        children = [self._make(child) for child in plan.children]
        given: dict[str, object] = dict(plan.attributes)
        node = plan.node
        if plan.mock is not None and plan.mockable is not None:
            return _mock_class(plan)(plan.name, plan.mock, **given)
        if node is SubTree:
            return self._make_subtree(plan, children[0], given)
        if issubclass(node, ControlNode):
            return node(plan.name, children, **given)
        if issubclass(node, DecoratorNode):
            return node(plan.name, children[0], **given)
        return node(plan.name, **given)

    def _make_subtree(self, plan: Plan, child: Node, given: dict[str, object]) -> SubTree:
        conditions = {key: given.pop(key) for key in plan.attributes if key in CONDITION_ATTRIBUTES}
        return SubTree(
            plan.name,
            child,
            {key: str(text) for key, text in given.items()},
            autoremap=SubTree.AUTOREMAP.convert(plan.element.attributes.get("_autoremap", False)),
            tree_id=plan.element.attributes["ID"],
            **conditions,
        )
