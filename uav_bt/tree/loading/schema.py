"""An XML Schema (XSD 1.0) of tree files, for editors: it completes, explains and underlines.

It allows everything that the loader accepts without a warning, and refuses unknown nodes and
attributes, missing ones, unknown choices and wrong counts of children. The rest (values, scripts,
variables, subtrees) is left to `uav-bt check`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final
from xml.etree import ElementTree as ET

from uav_bt.tree.describe import declared, default_text, summary
from uav_bt.tree.loading.elements import EDITOR_ATTRIBUTES, KIND_TAGS
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES, REFERENCE_KEY, Port
from uav_bt.tree.registry import NodeRegistry

_TAG: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
_REFERENCE: Final = rf"\{{\s*@?({REFERENCE_KEY})\s*\}}"


def schema_xml(registry: NodeRegistry) -> str:
    """Return a schema of the tree files that can be composed of a registry's nodes."""
    schema = ET.Element(
        "xs:schema",
        {"xmlns:xs": "http://www.w3.org/2001/XMLSchema", "elementFormDefault": "qualified"},
    )
    for add in (_add_attribute_groups, _add_root, _add_subtree):
        add(schema)
    nodes = [registry[node_id] for node_id in registry if node_id not in KIND_TAGS]
    described = {name: one for name, one in Lookup().described.items() if name not in registry}
    choice = _add(_add(schema, "group", name="node"), "choice")
    tags = filter(_TAG.fullmatch, [*(node.node_id for node in nodes), *described])
    for tag in (*tags, *(kind.value for kind in NodeKind)):
        _add(choice, "element", name=tag, type=f"node.{tag}")
    for node in nodes:
        if _TAG.fullmatch(node.node_id):
            _add_node(schema, node)
    for model in described.values():
        _add_described(schema, model)
    for kind in NodeKind:
        if kind is not NodeKind.SUBTREE:
            _add_explicit(schema, kind, [node.node_id for node in nodes if node.kind is kind])
    ET.indent(schema)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(schema, encoding="unicode")}\n'


def _add(parent: ET.Element, tag: str, /, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, f"xs:{tag}", attributes)


def _document(element: ET.Element, text: str) -> None:
    if text:
        _add(_add(element, "annotation"), "documentation").text = text


def _add_choices(parent: ET.Element, values: Iterable[str], **name: str) -> None:
    restriction = _add(_add(parent, "simpleType", **name), "restriction", base="xs:string")
    for value in values:
        _add(restriction, "enumeration", value=value)


def _add_attributes(parent: ET.Element, *names: str, **more: str) -> None:
    for name in names:
        _add(parent, "attribute", name=name, type="xs:string", **more)


def _add_attribute_groups(schema: ET.Element) -> None:
    editors = _add(schema, "attributeGroup", name="editor")
    _add_attributes(editors, *sorted(EDITOR_ATTRIBUTES))
    common = _add(schema, "attributeGroup", name="common")
    _add_attributes(common, "name", *sorted(CONDITION_ATTRIBUTES))
    _add(common, "attributeGroup", ref="editor")


def _add_root(schema: ET.Element) -> None:
    root = _add(schema, "element", name="root")
    content = _add(root, "complexType")
    inside = _add(content, "choice", minOccurs="0", maxOccurs="unbounded")
    include = _add(_add(inside, "element", name="include"), "complexType")
    _add_attributes(include, "path", use="required")
    tree = _add(_add(inside, "element", name="BehaviorTree"), "complexType")
    _add(tree, "group", ref="node")
    _add_attributes(tree, "ID", use="required")
    _add(tree, "attributeGroup", ref="editor")
    for tag in ("TreeNodesModel", "MetadataFields"):  # editors write these
        _add(inside, "element", name=tag, type="xs:anyType")
    _add_attributes(content, "BTCPP_format", use="required", fixed="4")
    _add_attributes(content, "main_tree_to_execute")
    _add_attributes(content, "project_name")
    _add(content, "attributeGroup", ref="editor")
    once = _add(root, "unique", name="tree")
    _add(once, "selector", xpath="BehaviorTree")
    _add(once, "field", xpath="@ID")


def _add_subtree(schema: ET.Element) -> None:
    content = _add(schema, "complexType", name="node.SubTree")
    _document(content, "Another tree of the file, with separate variables.")
    _add_attributes(content, "ID", use="required")
    _add_attributes(content, "_autoremap")
    _add(content, "attributeGroup", ref="common")
    _add(content, "anyAttribute", processContents="skip")


def _add_node(schema: ET.Element, node: type[Node]) -> None:
    content = _add(schema, "complexType", name=f"node.{node.node_id}")
    found = declared(node)
    keys = [("Reads", found.reads), ("Writes", found.writes)]
    lists = [f"{word} {', '.join(names)}." for word, names in keys if names]
    _document(content, " ".join([summary(node), *lists]))
    if node.max_children != 0:
        most = "unbounded" if node.max_children is None else str(node.max_children)
        _add(content, "group", ref="node", minOccurs=str(node.min_children), maxOccurs=most)
    for port in node.ports:
        _add_port(content, port)
    _add(content, "attributeGroup", ref="common")


def _add_port(content: ET.Element, port: Port[Any]) -> None:
    use = "required" if port.required else "optional"
    attribute = _add(content, "attribute", name=port.name, use=use)
    default = default_text(port)
    default = "" if default is None else f"default: {default}"
    _document(attribute, "; ".join(text for text in (port.doc, port.range, default) if text))
    if port.direction == "input" and port.type is str and port.choices:
        union = _add(_add(attribute, "simpleType"), "union")
        _add_choices(union, port.choices)
        reference = _add(_add(union, "simpleType"), "restriction", base="xs:token")
        _add(reference, "pattern", value=_REFERENCE)
    else:
        attribute.set("type", "xs:string")


def _add_described(schema: ET.Element, model: Element) -> None:
    """Add the short form of a SubTree whose tree ships: `<ReturnToBase/>`."""
    content = _add(schema, "complexType", name=f"node.{model.attributes['ID']}")
    for port in model.children:
        use = "optional" if port.attributes.get("default") else "required"
        name = port.attributes["name"]
        attribute = _add(content, "attribute", name=name, type="xs:string", use=use)
        _document(attribute, port.text)
    _add(content, "attributeGroup", ref="common")


def _add_explicit(schema: ET.Element, kind: NodeKind, ids: list[str]) -> None:
    content = _add(schema, "complexType", name=f"node.{kind.value}")
    if kind in {NodeKind.CONTROL, NodeKind.DECORATOR}:
        most = "unbounded" if kind is NodeKind.CONTROL else "1"
        _add(content, "group", ref="node", minOccurs="1", maxOccurs=most)
    which = _add(content, "attribute", name="ID", use="required")
    _add_choices(which, ids)
    _add(content, "attributeGroup", ref="common")
    _add(content, "anyAttribute", processContents="skip")
