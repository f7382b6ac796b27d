"""Node models: a TreeNodesModel describes nodes and their ports to graphical editors.

This loader reads enumerations in it besides: their members are the constants of scripts.

As a palette, a model makes the nodes of other engines known, so that their trees can be checked. It
has each node's kind, and each port's direction, type and default. It does not describe which ports
are required, how many children a node takes or how a node works. None of that is checked, and such
a node cannot be ticked.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import MissionError, did_you_mean
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.elements import KIND_TAGS, check_attributes
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings, Rule
from uav_bt.tree.loading.source import Element, parse_source, read_source
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import PORT_TYPES, Port
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.status import Status

PORT_DIRECTIONS: Final = {"input_port": "input", "output_port": "output", "inout_port": "inout"}
"""The tags of ports, with the direction that each means."""

_MODEL_ATTRIBUTES: Final = frozenset({"ID", "editable"})
_PORT_ATTRIBUTES: Final = frozenset({"name", "type", "default"})
# What engines and editors write into a model beside its ports, for people.
_REMARKS: Final = frozenset({"MetadataFields", "description"})
ENUMERATION: Final = "Enumeration"
"""The tag of an enumeration, which may have an ID, and of each member a name and a value."""
MEMBER: Final = "Member"
_MEMBER_NAME: Final = re.compile(r"(?!(?:true|false)$)[A-Za-z_]\w*", re.ASCII)
_MEMBER_VALUE: Final = re.compile(r"-?[0-9]{1,9}")

NodeModel = tuple[Element, dict[str, Element]]
"""A node as a model describes it, and its ports by name."""


def read_models(
    models: Element, enum_members: dict[str, int], findings: Findings
) -> dict[str, NodeModel]:
    """Read a TreeNodesModel: return nodes by ID, and add the members of enumerations.

    Most faults are warnings, because the engine does not read it. It does read the subtrees: one
    without ID, and a port of one without a name, are errors. So is a member with two values.
    """
    check_attributes(models, frozenset(), findings)
    found: dict[str, NodeModel] = {}
    for model in models.children:
        if model.tag == ENUMERATION:
            _read_members(model, enum_members, findings)
        elif model.tag in KIND_TAGS:
            check_attributes(model, _MODEL_ATTRIBUTES, findings)
            node_id, lack = model.attributes.get("ID", ""), _severity_of_lack(model)
            if not node_id:
                message = "attribute 'ID' is missing"
                findings.note(model, message, rule=Rule.NODE_MODEL, severity=lack)
            elif node_id in found:
                message = "described twice; the first counts"
                findings.warn(model, message, "ID", rule=Rule.NODE_MODEL)
            else:
                found[node_id] = model, _read_ports(model, findings)
        elif model.tag not in _REMARKS:
            hint = did_you_mean(model.tag, [*KIND_TAGS, ENUMERATION])
            findings.warn(model, f"<{model.tag}> means nothing in <TreeNodesModel>{hint}")
    return found


def _read_ports(model: Element, findings: Findings) -> dict[str, Element]:
    ports: dict[str, Element] = {}
    told = partial(findings.note, rule=Rule.NODE_MODEL, label=model.label, severity=WARNING)
    for port in model.children:
        name = port.attributes.get("name", "")
        if port.tag in PORT_DIRECTIONS:
            check_attributes(port, _PORT_ATTRIBUTES, findings)
            if not name:
                told(port, "attribute 'name' is missing", severity=_severity_of_lack(model))
            elif ports.setdefault(name, port) is not port:
                told(port, f"port '{name}' is described twice; the first counts", "name")
        elif port.tag not in _REMARKS:
            hint = did_you_mean(port.tag, PORT_DIRECTIONS)
            told(port, f"<{port.tag}> is not a port: its meaning is unknown{hint}", "name")
    return ports


def _severity_of_lack(model: Element) -> str:
    return ERROR if model.tag == NodeKind.SUBTREE.value else WARNING  # the engine reads subtrees


def _read_members(enumeration: Element, known: dict[str, int], findings: Findings) -> None:
    """Add the members of an enumeration, for which BehaviorTree.CPP has no form in a file."""
    check_attributes(enumeration, frozenset({"ID"}), findings)
    for member in enumeration.children:
        name, value = (member.attributes.get(key, "") for key in ("name", "value"))
        if member.tag != MEMBER:
            message = f"<{member.tag}> is not a member of an enumeration"
            message += f": write <{MEMBER} name= value=/>"
        elif not _MEMBER_NAME.fullmatch(name):
            message = f"attribute 'name': expected a name that scripts can use, got '{name}'"
        elif not _MEMBER_VALUE.fullmatch(value):
            message = f"attribute 'value': expected an integer, got '{value}'"
        elif known.setdefault(name, int(value)) != int(value):
            message = f"'{name}' is {known[name]} already: scripts could not tell which is meant"
        else:
            continue
        findings.note(member, message, rule=Rule.NODE_MODEL)


# --- palettes -------------------------------------------------------------------------------------

_STATUS: Final = ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED", "IDLE")
_SIGNED: Final = ("short", "long", "int8_t", "int16_t", "int32_t", "int64_t", "long long")
_UNSIGNED: Final = (
    *("unsigned", "unsigned int", "unsigned short", "unsigned long", "unsigned long long"),
    *("uint8_t", "uint16_t", "uint32_t", "uint64_t", "size_t"),
)
# Fields of ports by the names of types that C++ engines and editors write; every other type takes
# any text.
_TYPES: Final[dict[str, dict[str, Any]]] = {
    **{known.cpp_name: {"type": type_} for type_, known in PORT_TYPES.items()},
    **{name: {"type": int} for name in _SIGNED},
    **{name: {"type": int, "least": 0} for name in _UNSIGNED},
    **{name: {"type": str, "choices": _STATUS} for name in ("NodeStatus", "BT::NodeStatus")},
    "float": {"type": float},
    "string": {"type": str},
}
_BASES: Final[dict[str, type[Node]]] = {
    NodeKind.ACTION.value: Leaf,
    NodeKind.CONDITION.value: Leaf,
    NodeKind.CONTROL.value: ControlNode,
    NodeKind.DECORATOR.value: DecoratorNode,
}


@dataclass(frozen=True)
class PalettePort(Port[Any]):
    """A port of a palette, in which a required port is not marked."""

    @property
    def required(self) -> bool:
        """Never: a palette does not mark required ports."""
        return False


class PaletteNode(Node):
    """A node of a palette, which cannot be ticked."""

    def update(self) -> Status:
        """Refuse."""
        raise MissionError(
            f"'{self.node_id}' is known from a palette only: it can be checked, not ticked"
        )


def with_palette(
    registry: NodeRegistry, path: Path, findings: Findings | None = None
) -> NodeRegistry:
    """Return a registry with the nodes and enumerations of a palette beside those of another.

    Its trees may name any key of a board, as theirs has others than ours. A node of the format
    stays what it is. So does an installed node that the palette describes as it is (same kind, same
    ports), because we know more about it. Another node of that name replaces it, because the tree
    was made for that one. Trees and includes in the file are ignored, as are subtrees in the model.
    An unreadable type or default of a port is ignored, too; the node and the port stay.

    Args:
        registry: the other nodes.
        path: the file; its root is a TreeNodesModel, or holds one or several.
        findings: takes warnings of skipped parts.

    Raises:
        TreeError: the file cannot be read, or has no model.
    """
    root = parse_source(read_source(path), path)
    findings = Findings() if findings is None else findings
    models = [one for one in (root, *root.children) if one.tag == "TreeNodesModel"]
    if not models:
        expected = f"expected a <TreeNodesModel>, or a <root> that holds one; got <{root.tag}>"
        findings.add(path, root.position, expected, rule=Rule.NODE_MODEL)
    members: dict[str, int] = {}
    described: dict[str, type[Node]] = {}
    for each in models:
        for node_id, (model, ports) in read_models(each, members, findings).items():
            if model.tag in _BASES:
                described.setdefault(node_id, _node_of(model, ports, findings))
    findings.raise_any(path)
    for known in (registry[node_id] for node_id in registry):
        other = described.get(known.node_id, known)
        alike = other.kind is known.kind and _names(other) == _names(known)
        if alike or known in BUILTIN_NODES or known.node_id not in described:
            described[known.node_id] = known
    enum_members = {**registry.enum_members, **members}
    nodes = described.values()
    return replace(registry, nodes=nodes, foreign_board=True, enum_members=enum_members)


def _names(node: type[Node]) -> set[str]:
    return {port.name for port in node.ports}


def _node_of(model: Element, ports: dict[str, Element], findings: Findings) -> type[Node]:
    found = (_port_of(model, name, element, findings) for name, element in ports.items())
    members: dict[str, Any] = {
        "__doc__": "Known from a palette only.",
        "node_id": model.attributes["ID"],
        "condition": model.tag == NodeKind.CONDITION.value,
        "ports": tuple(port for port in found if port is not None),
    }
    return type(model.attributes["ID"], (PaletteNode, _BASES[model.tag]), members)


def _port_of(model: Element, name: str, element: Element, findings: Findings) -> PalettePort | None:
    facts = _TYPES.get(" ".join(element.attributes.get("type", "").split()), {"type": object})
    direction: Any = PORT_DIRECTIONS[element.tag]
    port, about, what = None, "name", ""
    try:
        port = PalettePort(
            name=name, doc=" ".join(element.text.split()), direction=direction, **facts
        )
        if default := element.attributes.get("default", ""):
            about, what = "default", f"port '{name}': "
            port.bind(default)
            return replace(port, default=default)
    except ValueError as error:
        left = "no default is used" if port else "the port is left out"
        message = f"{what}{error}; {left}"
        findings.warn(element, message, about, rule=Rule.NODE_MODEL, label=model.label)
    return port
