"""Node models, and nodes that are known from a palette only.

A TreeNodesModel describes nodes and their ports to graphical editors. This loader reads
enumerations in it besides: their members are the constants of scripts.

A palette is a TreeNodesModel, as Groot2 exports it and BehaviorTree.CPP writes it. It has each
node's kind and its ports, and each port's direction, type and default. It does not
describe which ports are required, how many children a node takes or how a node works. None of that
is checked, and such a node cannot be ticked.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import MissionError, did_you_mean
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.elements import check_attributes
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

_KINDS: Final = {kind.value: kind for kind in NodeKind}
_MODEL_ATTRIBUTES: Final = frozenset({"ID", "editable"})
_PORT_ATTRIBUTES: Final = frozenset({"name", "type", "default"})
# What engines and editors write into a model beside its ports, for people.
_REMARKS: Final = frozenset({"MetadataFields", "description"})
ENUMERATION: Final = "Enumeration"
"""The tag of an enumeration, which has an ID, and of each member a name and a value."""
MEMBER: Final = "Member"
_MEMBER_NAME: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_MEMBER_VALUE: Final = re.compile(r"-?[0-9]{1,9}")
# By the names that C++ engines and editors write; every other type takes any text.
_TYPES: Final[dict[str, type]] = {
    **{known.cpp_name: type_ for type_, known in PORT_TYPES.items()},
    **dict.fromkeys(("short", "long", "int8_t", "int16_t", "int32_t", "int64_t", "long long"), int),
    "float": float,
    "string": str,
}
_UNSIGNED: Final = frozenset(
    {"unsigned", "unsigned int", "unsigned short", "unsigned long", "uint8_t", "uint16_t"}
    | {"uint32_t", "uint64_t", "size_t", "unsigned long long"}
)
_STATUSES: Final = frozenset({"NodeStatus", "BT::NodeStatus"})
_STATUS_NAMES: Final = ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED", "IDLE")


@dataclass(frozen=True)
class NodeModel:
    """A node as a model describes it."""

    element: Element
    kind: NodeKind
    node_id: str
    ports: dict[str, Element]  # by the port's name


def read_models(models: Element, findings: Findings) -> list[NodeModel]:
    """Read a TreeNodesModel. Most faults are warnings because the engine does not read it."""
    check_attributes(models, frozenset(), findings)
    found: dict[str, NodeModel] = {}
    for model in models.children:
        kind = _KINDS.get(model.tag)
        if kind is None:
            if model.tag not in {ENUMERATION, *_REMARKS}:
                hint = did_you_mean(model.tag, [*_KINDS, ENUMERATION])
                findings.warn(model, f"<{model.tag}> means nothing in <TreeNodesModel>{hint}")
            continue
        check_attributes(model, _MODEL_ATTRIBUTES, findings)
        node_id = model.attributes.get("ID", "")
        if not node_id:
            _note(model, model, "attribute 'ID' is missing", findings, is_read=True)
        elif node_id in found:
            findings.warn(model, "described twice; the first counts", "ID", rule=Rule.NODE_MODEL)
        else:
            found[node_id] = NodeModel(model, kind, node_id, _read_ports(model, findings))
    return list(found.values())


def _read_ports(model: Element, findings: Findings) -> dict[str, Element]:
    ports: dict[str, Element] = {}
    for port in model.children:
        if port.tag in _REMARKS:
            continue
        if port.tag not in PORT_DIRECTIONS:
            hint = did_you_mean(port.tag, PORT_DIRECTIONS)
            _note(
                model, port, f"<{port.tag}> is not a port: its meaning is unknown{hint}", findings
            )
            continue
        check_attributes(port, _PORT_ATTRIBUTES, findings)
        name = port.attributes.get("name", "")
        if not name:
            _note(model, port, "attribute 'name' is missing", findings, is_read=True)
        elif name in ports:
            _note(model, port, f"port '{name}' is described twice; the first counts", findings)
        else:
            ports[name] = port
    return ports


def _note(
    model: Element, part: Element, message: str, findings: Findings, *, is_read: bool = False
) -> None:
    """Note a fault: an error where the engine reads it of a SubTree, a warning elsewhere."""
    refused = is_read and model.tag == NodeKind.SUBTREE.value
    severity = ERROR if refused else WARNING
    label, rule = model.label, Rule.NODE_MODEL
    findings.note(part, message, "name", rule=rule, label=label, severity=severity)


def read_enumerations(models: Element, enum_members: dict[str, int], findings: Findings) -> None:
    """Add the members of the enumerations in a TreeNodesModel to those that are known.

    BehaviorTree.CPP has no form for them in a file: there, a program registers them. It refuses
    a name with two values, too.
    """
    for enumeration in models.children:
        if enumeration.tag != ENUMERATION:
            continue
        check_attributes(enumeration, frozenset({"ID"}), findings)
        for member in enumeration.children:
            message = _wrong_member(member, enum_members)
            if message:
                findings.note(member, message, rule=Rule.NODE_MODEL)
            else:
                enum_members[member.attributes["name"]] = int(member.attributes["value"])


def _wrong_member(member: Element, known: dict[str, int]) -> str:
    name, value = (member.attributes.get(key, "") for key in ("name", "value"))
    if member.tag != MEMBER:
        return f"<{member.tag}> is not a member of an enumeration: write <{MEMBER} name= value=/>"
    if not _MEMBER_NAME.fullmatch(name) or name in {"true", "false"}:
        return f"attribute 'name': expected a name that scripts can use, got '{name}'"
    if not _MEMBER_VALUE.fullmatch(value):
        return f"attribute 'value': expected an integer, got '{value}'"
    if known.get(name, int(value)) != int(value):
        return f"'{name}' is {known[name]} already: scripts could not tell which is meant"
    return ""


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


_BASES: Final[dict[NodeKind, type[Node]]] = {
    NodeKind.ACTION: Leaf,
    NodeKind.CONDITION: Leaf,
    NodeKind.CONTROL: ControlNode,
    NodeKind.DECORATOR: DecoratorNode,
}


@dataclass(frozen=True)
class Palette:
    """Nodes and enumerations that a palette describes."""

    nodes: tuple[type[Node], ...]
    enum_members: dict[str, int]  # of its enumerations, for scripts


def read_palette(path: Path, odd: Findings | None = None) -> Palette:
    """Return node classes and enumerations from the TreeNodesModel of a file."""
    root = parse_source(read_source(path), path)
    findings = Findings() if odd is None else odd
    models = [one for one in (root, *root.children) if one.tag == "TreeNodesModel"]
    if not models:
        expected = f"expected a <TreeNodesModel>, or a <root> that holds one; got <{root.tag}>"
        findings.add(path, root.position, expected, rule=Rule.NODE_MODEL)
    nodes: dict[str, type[Node]] = {}
    enum_members: dict[str, int] = {}
    for element in models:
        read_enumerations(element, enum_members, findings)
        for model in read_models(element, findings):
            if model.kind in _BASES:
                nodes.setdefault(model.node_id, _node_of(model, findings))
    findings.raise_any(path)
    return Palette(tuple(nodes.values()), enum_members)


def _node_of(model: NodeModel, findings: Findings) -> type[Node]:
    ports = (_port_of(model, name, element, findings) for name, element in model.ports.items())
    return type(
        model.node_id,
        (PaletteNode, _BASES[model.kind]),
        {
            "__doc__": "Known from a palette only.",
            "node_id": model.node_id,
            "condition": model.kind is NodeKind.CONDITION,
            "ports": tuple(port for port in ports if port is not None),
        },
    )


def _port_of(
    model: NodeModel, name: str, element: Element, findings: Findings
) -> PalettePort | None:
    type_name = " ".join(element.attributes.get("type", "").split())
    is_status, is_unsigned = type_name in _STATUSES, type_name in _UNSIGNED
    port, about, what = None, "name", ""
    try:
        port = PalettePort(
            name=name,
            type=str if is_status else int if is_unsigned else _TYPES.get(type_name, object),
            doc=" ".join(element.text.split()),
            direction=PORT_DIRECTIONS[element.tag],  # type: ignore[arg-type]  # one of the three
            choices=_STATUS_NAMES if is_status else (),
            least=0 if is_unsigned else None,
        )
        if default := element.attributes.get("default", ""):
            about, what = "default", f"port '{name}': "
            port.bind(default)
            return replace(port, default=default)
    except ValueError as error:
        left = "no default is used" if port else "the port is left out"
        message, label = f"{what}{error}; {left}", model.element.label
        findings.warn(element, message, about, rule=Rule.NODE_MODEL, label=label)
    return port


def with_palette(registry: NodeRegistry, palette: Palette) -> NodeRegistry:
    """Return a registry with the nodes of a palette beside those of another registry.

    Its trees may name any key of a board, as theirs has others than ours. A node of the format
    stays what it is. So does an installed node that the palette describes as it is (same kind, same
    ports), because we know more about it. Another node of that name replaces it, because the tree
    was made for that one.
    """
    described = {node.node_id: node for node in palette.nodes}
    chosen: dict[str, type[Node]] = {}
    for node_id in registry:
        known = registry[node_id]
        other = described.pop(node_id, None)
        ours = other is None or known in BUILTIN_NODES or _looks_like(other, known)
        chosen[node_id] = known if ours or other is None else other
    return replace(
        registry,
        nodes=[*chosen.values(), *described.values()],
        foreign_board=True,
        enum_members={**registry.enum_members, **palette.enum_members},
    )


def _looks_like(model: type[Node], node: type[Node]) -> bool:
    names = {port.name for port in node.ports}
    return model.kind is node.kind and {port.name for port in model.ports} == names
