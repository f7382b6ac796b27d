"""Nodes that are known from a palette only, so that trees of other engines can be checked.

A palette is a TreeNodesModel, as Groot2 exports it and BehaviorTree.CPP writes it. It has each
node's kind and its ports, and each port's direction, type and default. It does not
describe which ports are required, how many children a node takes or how a node works. None of that
is checked, and such a node cannot be ticked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from uav_bt.errors import MissionError
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.models import PORT_DIRECTIONS, NodeModel, read_enumerations, read_models
from uav_bt.tree.loading.source import Element, parse_source, read_source
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.port import PORT_TYPES, Port
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.status import Status

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
    """Return node classes and enumerations from the TreeNodesModel of a file.

    Trees and includes in the file are ignored, as are subtrees in the model, which are not nodes.
    An unreadable type or default of a port is ignored, too; the node and the port stay.

    Args:
        path: the file; its root is a TreeNodesModel, or holds one or several.
        odd: collects warnings of skipped parts; default: none are kept.

    Raises:
        TreeError: the file cannot be read, or has no model.
    """
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
