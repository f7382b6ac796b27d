"""Node models: how a TreeNodesModel describes nodes and their ports to graphical editors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.elements import check_attributes
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings
from uav_bt.tree.loading.rules import Rule
from uav_bt.tree.loading.source import Element
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
    """Read a TreeNodesModel. What is odd in it is a warning, as the engine does not read it.

    It does read the subtrees' entries: a SubTree without ID, and a port of one without a name, are
    errors.

    Args:
        models: the TreeNodesModel.
        findings: where they are added.
    """
    check_attributes(models, frozenset(), findings)
    found: dict[str, NodeModel] = {}
    for model in models.children:
        kind = _KINDS.get(model.tag)
        if kind is None:
            if model.tag not in _REMARKS:
                hint = did_you_mean(model.tag, _KINDS)
                findings.warn(model, f"<{model.tag}> means nothing in <TreeNodesModel>{hint}")
            continue
        check_attributes(model, _MODEL_ATTRIBUTES, findings)
        node_id = model.attributes.get("ID", "")
        if not node_id:
            _note(model, model, "attribute 'ID' is missing", findings)
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
            message = f"<{port.tag}> is no port: what it describes is not known{hint}"
            _warn(model, port, message, findings)
            continue
        check_attributes(port, _PORT_ATTRIBUTES, findings)
        name = port.attributes.get("name", "")
        if not name:
            _note(model, port, "attribute 'name' is missing", findings)
        elif name in ports:
            _warn(model, port, f"port '{name}' is described twice; the first counts", findings)
        else:
            ports[name] = port
    return ports


def _warn(model: Element, part: Element, message: str, findings: Findings) -> None:
    where, label = part.at("name"), model.label
    findings.add(model.path, where, message, label, severity=WARNING, rule=Rule.NODE_MODEL)


def _note(model: Element, part: Element, message: str, findings: Findings) -> None:
    severity = ERROR if model.tag == NodeKind.SUBTREE.value else WARNING
    where, label = part.position, model.label
    findings.add(model.path, where, message, label, severity=severity, rule=Rule.NODE_MODEL)
