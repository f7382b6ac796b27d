"""Replacement of attributes of planned nodes by those that callers give, with the same checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from uav_bt.board import Key
from uav_bt.errors import did_you_mean
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.checker import Checker
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.findings import Findings, Position, errors_of
from uav_bt.tree.loading.parameters import SET, Parameters, split_port
from uav_bt.tree.loading.place_lists import takes_places
from uav_bt.tree.loading.plans import Plan
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.nodes import SubTree

_FIXED: Final = frozenset({"ID", "_autoremap", "name"})  # these say which nodes there are
_MAX_PATHS: Final = 6  # in a message, of nodes that a name fits


class Overrides:
    """Replaces attributes of the nodes of a document.

    Args:
        document: the file's outline.
        findings: collects the findings.
        plans: all nodes that are to be made of the file.
    """

    def __init__(self, document: Document, findings: Findings, plans: Sequence[Plan]) -> None:
        self._document = document
        self._findings = findings
        self._plans = plans
        self.replaced: dict[str, dict[str, str]] = {}  # attributes by path
        self._chosen: set[tuple[str, str]] = set()  # path and attribute, by the caller

    def take_by_key(self, by_key: Mapping[Key[Any], Mapping[str, str]]) -> None:
        """Replace attributes of all leaves that write a board key and have the port."""
        for plan in self._plans if by_key else ():
            taken = plan.node.values_taken(by_key) if issubclass(plan.node, Leaf) else {}
            if taken:
                self._replace(plan, taken, plan.node.node_id, None)

    def take(self, overrides: Mapping[str, Mapping[str, str]]) -> None:
        """Replace attributes of all nodes of a name or path."""
        for target, attributes in overrides.items():
            hits = self._hits(target, target, None)
            for plan in hits:
                self._replace(plan, attributes, target, None)
                self._chosen.update((plan.path, name) for name in attributes)

    def take_ports(self, parameters: Parameters) -> None:
        """Replace ports, each of the one node of a name or path."""
        for name, text in parameters.ports.items():
            target, port = split_port(name)
            place = parameters.places.get((SET, name))
            hits = self._hits(target, name, place)
            taken = [plan for plan in hits if (plan.path, port) in self._chosen]
            if taken:
                message = f"port '{name}' is given two values: leave one of them out"
                self._note(message, place, taken[0])
            elif len(hits) > 1:
                self._note(_choice(name, port, hits), place)
            elif hits:
                self._chosen.add((hits[0].path, port))
                self._replace(hits[0], {port: text}, name, place)

    def _hits(self, target: str, name: str, place: Place | None) -> list[Plan]:
        hits = [plan for plan in self._plans if target in (plan.name, plan.path)]
        if not hits:
            hint = did_you_mean(target, {plan.name for plan in self._plans})
            message = f"override of '{name}': the tree has no node of that name or path{hint}"
            self._note(message, place)
        return hits

    def _note(self, message: str, place: Place | None, plan: Plan | None = None) -> None:
        element = None if plan is None else plan.element
        if place is None and element is not None:
            place = Place(element.path, element.position)
        at = place or Place(self._document.path, Position(1, 1))
        self._findings.add(at.path, at.position, message, "" if element is None else element.label)

    def _replace(
        self, plan: Plan, attributes: Mapping[str, str], name: str, place: Place | None
    ) -> None:
        attributes = {
            port: self._with_places(plan, port, text, place) for port, text in attributes.items()
        }
        plan.attributes.update(attributes)
        self.replaced.setdefault(plan.path, {}).update(attributes)
        lead = f"override of '{name}': "
        for message in self._refused(plan, attributes):
            self._note(f"{lead}{message}", place, plan)
        # The file itself is good by now, so whatever is found comes from the override.
        found = Findings()
        element = replace(plan.element, attributes={**plan.element.attributes, **attributes})
        Checker(self._document, found).check_element(element)
        for finding in errors_of(found):
            at = place or Place(element.path, finding.position)
            self._findings.add(at.path, at.position, f"{lead}{finding.message}", finding.node)

    def _with_places(self, plan: Plan, port: str, text: str, place: Place | None) -> str:
        """Return a value with the places of the files that it names."""
        document = self._document
        if not takes_places(plan.element, port, document.registry):
            return text
        at = place or Place(document.path, Position(1, 1))
        return document.place_lists.in_override(text, f"{plan.name}.{port}", document.path, at)

    def _refused(self, plan: Plan, attributes: Mapping[str, str]) -> list[str]:
        """Return the faults of attributes that only a replacement can have."""
        node = plan.node
        fixed = _FIXED.intersection(attributes)
        messages = [f"'{name}' cannot be replaced" for name in fixed]
        if node is SubTree:
            # Neither the subtree's description nor the file knows others.
            described = (
                self._document.subtree_ports.get(plan.element.attributes.get("ID", "")) or {}
            )
            known = {*described, *plan.element.attributes}
            messages += [
                f"the tree has no port '{name}'{did_you_mean(name, known)}"
                for name in attributes
                if not name.startswith("_") and name not in known
            ]
        return messages + [
            f"unknown attribute '{name}'{did_you_mean(name, CONDITION_ATTRIBUTES)}"
            for name in attributes
            if name.startswith("_") and name not in CONDITION_ATTRIBUTES | _FIXED
        ]


def _choice(name: str, port: str, hits: Sequence[Plan]) -> str:
    """Return the message that a name fits several nodes."""
    paths = [f"'{plan.path}.{port}'" for plan in hits]
    more = f" and {len(paths) - _MAX_PATHS} more" if len(paths) > _MAX_PATHS else ""
    return (
        f"'{name}' fits {len(hits)} nodes: name one by its path, such as "
        f"{', '.join(paths[:_MAX_PATHS])}{more}"
    )
