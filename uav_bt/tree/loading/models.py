"""Node models: how a TreeNodesModel describes nodes and their ports to graphical editors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import Element, check_attributes
from uav_bt.tree.node import NodeKind

PORT_DIRECTIONS: Final = {"input_port": "input", "output_port": "output", "inout_port": "inout"}
"""The tags of ports, with the direction that each means."""

_KINDS: Final = {kind.value: kind for kind in NodeKind}
_MODEL_ATTRIBUTES: Final = frozenset({"ID", "editable"})
_PORT_ATTRIBUTES: Final = frozenset({"name", "type", "default"})
# What engines and editors write into a model beside its ports, for people.
_REMARKS: Final = frozenset({"MetadataFields", "description"})


@dataclass(frozen=True)
class NodeModel:
    """A node as a model describes it."""

    element: Element
    kind: NodeKind
    node_id: str
    ports: dict[str, Element]  # by the port's name


def read_models(models: Element, findings: Findings) -> list[NodeModel]:
    """Read a TreeNodesModel; what is wrong with it is noted, and the rest returned.

    Args:
        models: the TreeNodesModel.
        findings: where they are added.
    """
    check_attributes(models, frozenset(), findings)
    seen: set[str] = set()
    found: list[NodeModel] = []
    for model in models.children:
        kind = _KINDS.get(model.tag)
        if kind is None:
            findings.add(
                model.path,
                model.position,
                f"<{model.tag}> cannot stand in <TreeNodesModel>{did_you_mean(model.tag, _KINDS)}",
            )
            continue
        check_attributes(model, _MODEL_ATTRIBUTES, findings)
        node_id = model.attributes.get("ID", "")
        if not node_id:
            findings.add(model.path, model.position, "attribute 'ID' is missing", model.tag)
            continue
        if node_id in seen:
            findings.note(model, "described twice", "ID")
        seen.add(node_id)
        found.append(NodeModel(model, kind, node_id, _read_ports(model, findings)))
    return found


def _read_ports(model: Element, findings: Findings) -> dict[str, Element]:
    path = model.path
    ports: dict[str, Element] = {}
    for port in model.children:
        if port.tag in _REMARKS:
            continue
        if port.tag not in PORT_DIRECTIONS:
            findings.add(
                path,
                port.position,
                f"<{port.tag}> cannot stand here{did_you_mean(port.tag, PORT_DIRECTIONS)}",
                model.label,
            )
            continue
        check_attributes(port, _PORT_ATTRIBUTES, findings)
        name = port.attributes.get("name", "")
        if not name:
            findings.add(path, port.position, "attribute 'name' is missing", model.label)
        elif name in ports:
            findings.add(path, port.at("name"), f"port '{name}' is described twice", model.label)
        else:
            ports[name] = port
    return ports
