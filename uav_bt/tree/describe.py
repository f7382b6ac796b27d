"""What nodes there are: as data for lists, as a page, and as a model for graphical editors."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree as ET

from uav_bt.board.blackboard import Key
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.source import to_xml
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.port import PORT_TYPES, Port, port_text
from uav_bt.tree.registry import NodeRegistry

ABILITIES: Final = {"moves": "moves", "points": "points the camera", "lands": "lands"}
"""Class attributes of leaves for their effect on the drone, each with its description."""

# A value of each type, for ports that a tree file must give.
_SAMPLES: Final = {float: "1.0", int: "1", bool: "true"}


class Declared(NamedTuple):
    """Names of what a leaf declares; nothing for another node."""

    reads: tuple[str, ...] = ()  # board keys
    writes: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()  # the statuses that it gives
    abilities: tuple[str, ...] = ()  # moves, points, lands


def summary(node: type[Node]) -> str:
    """Return the first line of a node class's docstring."""
    return (node.__doc__ or "").strip().partition("\n")[0].strip()


def default_text(port: Port[Any]) -> str | None:
    """Return the default of a port as a tree file has it; None if there is none."""
    return None if port.default is Port.REQUIRED else port_text(port.default)


def _names(keys: Iterable[Key[Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(key.name for key in keys))


def declared(node: type[Node]) -> Declared:
    """Return what a node declares besides its ports."""
    if not issubclass(node, Leaf):
        return Declared()
    return Declared(
        reads=_names(node.reads),
        writes=_names(node.writes),
        answers=tuple(answer.name for answer in node.answers),
        abilities=tuple(name for name in ABILITIES if getattr(node, name, False)),
    )


def origin(node: type[Node]) -> str:
    """Return module and name of a node's class."""
    return f"{node.__module__}.{node.__qualname__}"


def in_order(registry: NodeRegistry) -> list[type[Node]]:
    """Return all nodes of a registry: missions' own first, then the format's, by kind and name."""
    kinds, nodes = list(NodeKind), (registry[node_id] for node_id in registry)
    return sorted(nodes, key=lambda one: (one in BUILTIN_NODES, kinds.index(one.kind), one.node_id))


def _own(registry: NodeRegistry) -> list[type[Node]]:
    """Return the nodes that are not the format's."""
    return [registry[name] for name in registry if registry[name] not in BUILTIN_NODES]


# --- a page in Markdown ---------------------------------------------------------------------------


def node_page(registry: NodeRegistry) -> str:
    """Return a page about the nodes of a registry that are not the format's."""
    nodes = _own(registry)
    links = ", ".join(f"[{node.node_id}](#{node.node_id.lower()})" for node in nodes)
    sections = ["\n\n".join(section(node)) for node in nodes]
    return "\n\n".join([f"# Nodes\n\n{links}", *sections]) + "\n"


def example(node: type[Node]) -> str:
    """Return a tag of the node with a value for each port that a tree file must give."""
    given = "".join(f' {port.name}="{_sample(port)}"' for port in node.ports if port.required)
    return f"<{node.node_id}{given}/>"


def section(node: type[Node]) -> Iterator[str]:
    """Yield the paragraphs about a node."""
    found = declared(node)
    yield f"## {node.node_id}"
    # The attributes of a class have a table here.
    yield inspect.cleandoc(node.__doc__ or "").partition("\nArgs:")[0].strip()
    yield f"Example: `{example(node)}`"
    if node.ports:
        head = ["| port | type | default | meaning |", "|---|---|---|---|"]
        yield "\n".join([*head, *map(_row, node.ports)])
    answers = f" Answers {', '.join(found.answers)}." if found.answers else ""
    abilities = [ABILITIES[name] for name in found.abilities]
    does = f" It {' and '.join(abilities)}." if abilities else ""
    keys = "".join(
        f" {verb} {', '.join(f'`{key}`' for key in keys)}."
        for verb, keys in (("Reads", found.reads), ("Writes", found.writes))
        if keys
    )
    yield f"{node.kind.value}.{answers}{does}{keys} Source: `{origin(node)}`."


def _sample(port: Port[Any]) -> str:
    return port.sample or port_text((*port.choices, _SAMPLES.get(port.type, "name"))[0])


def _row(port: Port[Any]) -> str:
    default = default_text(port)
    value = "required" if port.required else f"`{default}`" if default else ""
    value = "output" if port.direction == "output" else value
    doc = _doc(port).replace("|", "\\|")
    return f"| `{port.name}` | {port.type.__name__} | {value} | {doc} |"


def _doc(port: Port[Any]) -> str:
    return f"{port.doc} ({port.range})" if port.range else port.doc


# --- a model for graphical editors ----------------------------------------------------------------


def palette_xml(registry: NodeRegistry) -> str:
    """Return a TreeNodesModel of the nodes that are not the format's, and of described trees.

    A graphical editor imports it and offers the nodes with their ports. The loader accepts the
    files that the editor saves.
    """
    root = ET.Element("root", BTCPP_format="4")
    model = ET.SubElement(root, "TreeNodesModel")
    for node in _own(registry):
        add_model(model, node)
    model.extend(map(to_xml, Lookup().described.values()))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def add_model(models: ET.Element, node: type[Node]) -> None:
    """Add a node to a TreeNodesModel."""
    element = ET.SubElement(models, node.kind.value, ID=node.node_id)
    for port in node.ports:
        known = PORT_TYPES.get(port.type)
        name = port.type.__name__ if known is None else known.cpp_name
        entry = ET.SubElement(element, f"{port.direction}_port", name=port.name, type=name)
        if (default := default_text(port)) is not None:
            entry.set("default", default)
        entry.text = _doc(port)
