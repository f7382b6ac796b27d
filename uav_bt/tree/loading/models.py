"""Node models: how a TreeNodesModel describes nodes and their ports to graphical editors.

This loader reads enumerations in it besides: their members are the constants of scripts.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.elements import check_attributes
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings, Rule
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import NodeKind

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


@dataclass(frozen=True)
class NodeModel:
    """A node as a model describes it."""

    element: Element
    kind: NodeKind
    node_id: str
    ports: dict[str, Element]  # by the port's name


def read_models(models: Element, findings: Findings) -> list[NodeModel]:
    """Read a TreeNodesModel. Most faults are warnings because the engine does not read it.

    It does read the subtrees' entries: a SubTree without ID, and a port of one without a name, are
    errors.
    """
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
