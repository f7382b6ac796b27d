"""One element of a file: its node and children, its ports bound, its scripts checked."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from uav_bt.clock import TIME_LIMIT_S
from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import KIND_TAGS, node_id_of
from uav_bt.tree.loading.findings import WARNING, Findings, Rule
from uav_bt.tree.loading.source import Element, walk
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import ReactiveSequence
from uav_bt.tree.port import (
    ASKED,
    CONDITION_ATTRIBUTES,
    Port,
    bind_ports,
    parse_reference,
)
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.script.parser import SCRIPTS, Script, parse_question
from uav_bt.tree.script.values import ScriptError

POLICY_PORT: Final = "policy"  # by this name a leaf declares the port that names its leaf policy
_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
# Users write right angles and their parts in radians, such as 1.047 for 60 degrees.
_STEP_RAD: Final = math.pi / 12
_STEP_SHARE: Final = 0.01  # largest relative distance from a multiple of the step; chosen
_LEAST_MSEC: Final = 10  # a shorter time is less than a tick and probably in seconds; chosen
_TIME_LIMIT: Final = "time_limit_s"  # a port that states the limit is not measured by it


Note = Callable[..., None]
"""Takes a fault of a node's attribute: message, attribute, and perhaps rule= and severity=."""


class Attributes:
    """Checks attributes, of which each fault goes to a `Note`."""

    def __init__(self, document: Document) -> None:
        self._members = document.enum_members

    def bound(
        self, ports: Iterable[Port[Any]], given: Mapping[str, str], note: Note
    ) -> tuple[dict[str, Any], bool]:
        """Return the values and references of ports that are right, and whether all are."""
        ports = list(ports)
        bound, wrong = bind_ports(ports, dict(given))
        scripts = {port.name for port in ports if port.check in SCRIPTS}
        for name, message in wrong.items():
            note(message, name, rule=Rule.SCRIPT if name in scripts else Rule.ATTRIBUTE)
        for port in ports:
            value = bound.get(port.name)
            if (script := port.script(value)) is not None:
                self._check_script(script, port.name, note, asked=port.check is parse_question)
            elif port.name in given and (doubt := _unit_doubt(port, value)) is not None:
                note(
                    f"attribute '{port.name}': {doubt}", port.name, rule=Rule.UNIT, severity=WARNING
                )
        return bound, not wrong

    def conditions(self, given: Mapping[str, str], note: Note) -> dict[str, str]:
        """Return the conditions among attributes, without those that cannot be parsed."""
        good = {name: text for name, text in given.items() if name in CONDITION_ATTRIBUTES}
        for name, text in [*good.items()]:
            try:
                self._check_script(parse_question(text), name, note, asked=name in ASKED)
            except ScriptError as error:
                note(f"attribute '{name}': {error}", name, rule=Rule.SCRIPT)
                del good[name]
        return good

    def entries(self, given: Mapping[str, str], note: Note) -> dict[str, str]:
        """Return the entries of a SubTree among attributes."""
        good = {name: text for name, text in given.items() if name not in CONDITION_ATTRIBUTES}
        for name, text in [*good.items()]:
            if not _VARIABLE.fullmatch(name):
                note(f"'{name}' cannot be a variable's name", name)
            try:
                parse_reference(text, name)
            except ValueError as error:
                note(f"attribute '{name}': {error}", name)
                good[name] = ""
        return good

    def _check_script(self, script: Script, name: str, note: Note, *, asked: bool) -> None:
        fault = script.fault(self._members, asked=asked)
        lead = f"attribute '{name}': "
        if fault is not None:
            note(f"{lead}the script always fails: {fault}", name, rule=Rule.SCRIPT)
        for odd in script.oddities:
            note(f"{lead}{odd}", name, rule=Rule.SCRIPT, severity=WARNING)


def _unit_doubt(port: Port[Any], value: object) -> str | None:
    """Return why a literal was probably written in another unit than the port's, if it was."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if _has_unit(port, "degrees", "deg"):
        return _radians(value)
    lasts = _has_unit(port, "seconds", "s") and port.name != _TIME_LIMIT
    if lasts and value > TIME_LIMIT_S:
        return (
            f"{value:g} s is longer than a mission, whose time limit is {TIME_LIMIT_S:g} s unless "
            "its Rules or the flight's options raise it"
        )
    if _has_unit(port, "msec", "msec", "ms") and 0 < value < _LEAST_MSEC:
        return f"{value:g} ms is shorter than a tick; for {value:g} s write {1000 * value:g}"
    return None


def _has_unit(port: Port[Any], name: str, *endings: str) -> bool:
    return port.name == name or port.name.endswith(tuple(f"_{ending}" for ending in endings))


def _radians(value: float) -> str | None:
    if not 0.0 < abs(value) <= math.tau or (2 * value).is_integer():
        return None
    steps = round(abs(value) / _STEP_RAD)
    if abs(abs(value) - steps * _STEP_RAD) > _STEP_SHARE * steps * _STEP_RAD:
        return None
    meant_deg = math.copysign(15 * steps, value)
    return f"{value:g} degrees looks like radians; for {meant_deg:g} degrees write {meant_deg:g}"


_ASYNCHRONOUS: Final = "AsyncSequence"  # the only child that the engine counts


def node_class(element: Element, document: Document, findings: Findings) -> type[Node] | None:
    """Return the class of a node that is no SubTree; None for an unknown one."""
    node_id = node_id_of(element)
    if not node_id:
        findings.note(element, f"<{element.tag}> needs an attribute 'ID'", rule=Rule.ATTRIBUTE)
        return None
    node = document.registry.get(node_id)
    if node is None:
        attribute = "ID" if element.tag in KIND_TAGS else ""
        message = f"unknown node '{node_id}'{_other_node(node_id, document)}"
        findings.note(element, message, attribute, rule=Rule.UNKNOWN_NODE)
        return None
    if element.tag in KIND_TAGS and element.tag != node.kind.value:
        message = f"'{node_id}' is of kind {node.kind.value}, not {element.tag}"
        findings.warn(element, message, "ID", rule=Rule.UNKNOWN_NODE)
    elif element.tag not in KIND_TAGS and "ID" in element.attributes:
        message = "unknown attribute 'ID': the tag says which node it is"
        findings.note(element, message, "ID", rule=Rule.ATTRIBUTE)
    _check_children(element, node.min_children, node.max_children, findings)
    if node is ReactiveSequence:
        running = [child for child in element.children if child.tag == _ASYNCHRONOUS]
        for child in running[1:]:
            message = f"a ReactiveSequence can have one {_ASYNCHRONOUS}: each stops the others"
            findings.note(child, f"{message} when it runs", rule=Rule.CHILDREN)
    return node


def _other_node(node_id: str, document: Document) -> str:
    """Return what may be meant by an unknown node."""
    if node_id in document.trees:
        return f'; it is a tree of this file: write <SubTree ID="{node_id}"/>'
    registry = document.registry
    hint = did_you_mean(node_id, [*registry, *document.lookup.described])
    hint = hint or "; --leaves FILE.py or an installed package adds nodes"
    return hint + "".join(f"; not loaded: {fault}" for fault in registry.faults)


def check_subtree(element: Element, registry: NodeRegistry, findings: Findings) -> None:
    """Refuse a SubTree that has children, or that names no tree."""
    _check_children(element, 0, 0, findings)
    tree_id = element.attributes.get("ID", "")
    if not tree_id:
        findings.note(element, "attribute 'ID' is missing", rule=Rule.ATTRIBUTE)
    elif tree_id in registry:
        message = f"'{tree_id}' is a node, no tree: write <{tree_id}/>"
        findings.note(element, message, "ID", rule=Rule.UNKNOWN_TREE)


def _check_children(element: Element, least: int, most: int | None, findings: Findings) -> None:
    count = len(element.children)
    if count >= least and (most is None or count <= most):
        return
    if most is None:
        needed = f"at least {least}"
    elif most != least:
        needed = f"{least} to {most} children"
    else:
        words = {0: "no children", 1: "exactly one child"}
        needed = words.get(least, f"exactly {least} children")
    findings.note(element, f"needs {needed}, has {count}", rule=Rule.CHILDREN)


def check_names(tree: Element, findings: Findings) -> None:
    """Refuse two SubTrees of one name under one tree, as the engine does since 4.8.4."""
    first: dict[str, Element] = {}
    for element in walk(tree):
        name = element.attributes.get("name") if element.tag == NodeKind.SUBTREE.value else None
        if not name or first.setdefault(name, element) is element:
            continue
        if {"ID", "name"} <= element.attribute_positions.keys():  # no short form
            findings.note(
                element,
                f"the SubTree at {first[name].path}:{first[name].position} has this name, too: "
                "names of SubTrees are unique in a tree; leave it out, or choose another",
                "name",
                rule=Rule.TREE_ID,
            )
