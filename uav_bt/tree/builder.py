"""From checked elements to nodes: subtrees put in place, overrides applied, everything bounded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import TreeError, did_you_mean
from uav_bt.tree.checker import node_attributes, node_id_of
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.document import Document, label
from uav_bt.tree.findings import Findings, Position
from uav_bt.tree.mission_tree import child_paths
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.nodes.control import ControlNode
from uav_bt.tree.nodes.decorator import DecoratorNode
from uav_bt.tree.port import bind_ports
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.source import MAX_DEPTH, Element

__all__ = ["MAX_NODES", "Builder"]

MAX_NODES: Final = 20_000  # subtrees inside subtrees multiply


@dataclass
class _Plan:
    """A node to be made."""

    element: Element
    name: str
    path: str
    attributes: dict[str, str]
    children: list[_Plan]

    def walk(self) -> Iterator[_Plan]:
        yield self
        for child in self.children:
            yield from child.walk()


class _TooLargeError(Exception):
    pass


class Builder:
    """Makes the nodes of a document's main tree."""

    def __init__(self, document: Document, registry: NodeRegistry, findings: Findings) -> None:
        self._document = document
        self._registry = registry
        self._findings = findings
        self._count = 0

    def build(self, overrides: Mapping[str, Mapping[str, str]]) -> Node:
        """Return the root node.

        Args:
            overrides: attribute values by node, which is named by its name or its path.

        Raises:
            TreeError: the tree grows too large, or an override does not fit.
        """
        main = self._document.trees[self._document.main]
        root = main.children[0]
        name = _name_of(root)
        try:
            plan = self._plan(root, name, f"{self._document.main}/{name}", depth=1)
        except _TooLargeError as error:
            where = f"{main.path}:{main.position}"
            raise TreeError(self._document.path, [f"{where}: {label(main)}: {error}"]) from error
        self._apply(overrides, plan)
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
        return _Plan(element, name, path, node_attributes(element), children)

    def _apply(self, overrides: Mapping[str, Mapping[str, str]], root: _Plan) -> None:
        plans = list(root.walk())
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
                plan.attributes.update(attributes)
                self._check_override(target, attributes, plan)

    def _check_override(self, target: str, attributes: Mapping[str, str], plan: _Plan) -> None:
        if plan.element.tag == NodeKind.SUBTREE.value:
            return
        given: dict[str, object] = dict(plan.attributes)
        for name in CONDITION_ATTRIBUTES.intersection(given):
            del given[name]
        _, wrong = bind_ports(self._registry[node_id_of(plan.element)].ports, given)
        for name, message in wrong.items():
            if name in attributes:
                self._findings.add(
                    plan.element.path,
                    plan.element.position,
                    f"override of '{target}': {message}",
                    label(plan.element),
                )

    def _make(self, plan: _Plan) -> Node:
        children = [self._make(child) for child in plan.children]
        given: dict[str, object] = dict(plan.attributes)
        if plan.element.tag == NodeKind.SUBTREE.value:
            autoremap = SubTree.AUTOREMAP.convert(plan.element.attributes.get("_autoremap", False))
            conditions = {
                key: given.pop(key) for key in plan.attributes if key in CONDITION_ATTRIBUTES
            }
            entries = {key: str(text) for key, text in given.items()}
            return SubTree(plan.name, children[0], entries, autoremap=autoremap, **conditions)
        node = self._registry[node_id_of(plan.element)]
        if issubclass(node, ControlNode):
            return node(plan.name, children, **given)
        if issubclass(node, DecoratorNode):
            return node(plan.name, children[0], **given)
        return node(plan.name, **given)


def _name_of(element: Element) -> str:
    name = element.attributes.get("name")
    if name:
        return name
    if element.tag == NodeKind.SUBTREE.value:
        return element.attributes["ID"]
    return node_id_of(element)
