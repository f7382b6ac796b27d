"""What nodes there are, as data for lists and as a model that graphical editors load."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final
from xml.etree import ElementTree as ET

from uav_bt.board.blackboard import Key
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.port import PORT_TYPES, Port, port_text
from uav_bt.tree.registry import NodeRegistry


@dataclass(frozen=True, kw_only=True)
class PortInfo:
    """A port, as a person reads it."""

    name: str
    type: str  # the Python type's name
    default: str | None  # None: the tree file must give a value, or it is an output
    doc: str
    direction: str
    choices: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    range: str = ""  # both in words
    required: bool = False  # a tree file must give it
    sample: str = ""  # a value for examples


@dataclass(frozen=True, kw_only=True)
class NodeInfo:
    """A node, as a person reads it."""

    node_id: str
    kind: str  # Action, Condition, Control, Decorator or SubTree
    doc: str  # one line
    ports: tuple[PortInfo, ...]
    reads: tuple[str, ...]  # board keys
    writes: tuple[str, ...]
    answers: tuple[str, ...]  # of a leaf: the statuses that it gives
    abilities: tuple[str, ...]  # of a leaf: moves, points, lands
    builtin: bool  # one of the format's own
    origin: str  # module and class


ABILITIES: Final = {"moves": "moves", "points": "points the camera", "lands": "lands"}
"""Class attributes of leaves for their effect on the drone, each with its description."""


def summary(node: type[Node]) -> str:
    """Return the first line of a node class's docstring."""
    lines = (node.__doc__ or "").strip().splitlines()
    return lines[0].strip() if lines else ""


def _describe_port(port: Port[Any]) -> PortInfo:
    return PortInfo(
        name=port.name,
        type=port.type.__name__,
        default=None if port.default is Port.REQUIRED else port_text(port.default),
        doc=port.doc,
        direction=port.direction,
        choices=tuple(port_text(choice) for choice in port.choices),
        least=port.least,
        most=port.most,
        range=port.range,
        required=port.required,
        sample=port.sample,
    )


def _names(keys: Iterable[Key[Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(key.name for key in keys))


def describe(node: type[Node]) -> NodeInfo:
    """Return the description of a node for people."""
    leaf = node if issubclass(node, Leaf) else None
    return NodeInfo(
        node_id=node.node_id,
        kind=node.kind.value,
        doc=summary(node),
        ports=tuple(_describe_port(port) for port in node.ports),
        reads=_names(leaf.reads) if leaf else (),
        writes=_names(leaf.writes) if leaf else (),
        answers=tuple(answer.name for answer in leaf.answers) if leaf else (),
        abilities=tuple(name for name in ABILITIES if getattr(leaf, name, False)),
        builtin=node in BUILTIN_NODES,
        origin=f"{node.__module__}.{node.__qualname__}",
    )


def describe_all(registry: NodeRegistry) -> list[NodeInfo]:
    """Return all nodes of a registry: missions' own first, then the format's, by kind and name."""
    order = [kind.value for kind in NodeKind]
    infos = [describe(registry[node_id]) for node_id in registry]
    return sorted(infos, key=lambda info: (info.builtin, order.index(info.kind), info.node_id))


def palette_xml(registry: NodeRegistry) -> str:
    """Return a TreeNodesModel of the nodes that are not the format's own, and of described trees.

    A graphical editor imports it and offers the nodes with their ports. The loader accepts the
    files that the editor saves.
    """
    root = ET.Element("root", BTCPP_format="4")
    model = ET.SubElement(root, "TreeNodesModel")
    for node_id in registry:
        if registry[node_id] not in BUILTIN_NODES:
            add_model(model, registry[node_id])
    model.extend(map(_copied, Lookup().described.values()))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _copied(element: Element) -> ET.Element:
    copy = ET.Element(element.tag, element.attributes)
    copy.text = element.text or None
    copy.extend(map(_copied, element.children))
    return copy


def add_model(parent: ET.Element, node: type[Node]) -> None:
    """Describe a node class to graphical editors.

    Args:
        parent: the TreeNodesModel.
        node: the class.
    """
    element = ET.SubElement(parent, node.kind.value, ID=node.node_id)
    for port in node.ports:
        known = PORT_TYPES.get(port.type)
        name = port.type.__name__ if known is None else known.cpp_name
        entry = ET.SubElement(element, f"{port.direction}_port", name=port.name, type=name)
        if port.default is not Port.REQUIRED:
            entry.set("default", port_text(port.default))
        entry.text = f"{port.doc} ({port.range})" if port.range else port.doc
