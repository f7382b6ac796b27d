"""An XML Schema (XSD 1.0) of tree files, for editors: it completes, explains and underlines.

It allows everything that the loader accepts without a warning, and refuses unknown nodes and
attributes, missing ones, literals of another type and wrong counts of children. The rest (scripts,
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
from uav_bt.tree.port import CONDITION_ATTRIBUTES, PORT_TYPES, REFERENCE_KEY, Port
from uav_bt.tree.registry import NodeRegistry

_TAG: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
_PATTERNS: Final = {type_: known.pattern for type_, known in PORT_TYPES.items() if known.pattern}
_NAMES: Final[dict[type, str]] = {int: "integer", float: "number", bool: "boolean"}
_REFERENCE: Final = rf"\{{\s*@?({REFERENCE_KEY})\s*\}}"


def schema_xml(registry: NodeRegistry) -> str:
    """Return a schema of the tree files that can be composed of a registry's nodes."""
    schema = ET.Element(
        "xs:schema",
        {"xmlns:xs": "http://www.w3.org/2001/XMLSchema", "elementFormDefault": "qualified"},
    )
    for add in (_add_values, _add_attribute_groups, _add_root, _add_subtree):
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


def _add_restriction(
    parent: ET.Element, base: str, facet: str, values: Iterable[str], **name: str
) -> ET.Element:
    restriction = _add(_add(parent, "simpleType", **name), "restriction", base=base)
    for value in values:
        _add(restriction, facet, value=value)
    return restriction


def _add_values(schema: ET.Element) -> None:
    # Of a token, blanks at both ends do not count, as the loader has it.
    _add_restriction(schema, "xs:token", "pattern", [_REFERENCE], name="value.reference")
    for type_, name in _NAMES.items():
        pattern = _PATTERNS[type_]
        _add_restriction(schema, "xs:token", "pattern", [pattern], name=f"value.{name}")
        either = _add(schema, "simpleType", name=f"port.{name}")
        _add(either, "union", memberTypes=f"value.{name} value.reference")
    _add_restriction(schema, "xs:string", "minLength", ["1"], name="value.name")


def _add_attributes(parent: ET.Element, type_: str, *names: str, **more: str) -> None:
    for name in names:
        _add(parent, "attribute", name=name, type=type_, **more)


def _add_attribute_groups(schema: ET.Element) -> None:
    editors = _add(schema, "attributeGroup", name="editor")
    _add_attributes(editors, "xs:string", *sorted(EDITOR_ATTRIBUTES))
    common = _add(schema, "attributeGroup", name="common")
    _add_attributes(common, "xs:string", "name", *sorted(CONDITION_ATTRIBUTES))
    _add(common, "attributeGroup", ref="editor")


def _add_root(schema: ET.Element) -> None:
    root = _add(schema, "element", name="root")
    content = _add(root, "complexType")
    inside = _add(content, "choice", minOccurs="0", maxOccurs="unbounded")
    include = _add(_add(inside, "element", name="include"), "complexType")
    _add_attributes(include, "value.name", "path", use="required")
    tree = _add(_add(inside, "element", name="BehaviorTree"), "complexType")
    _add(tree, "group", ref="node")
    _add_attributes(tree, "value.name", "ID", use="required")
    _add(tree, "attributeGroup", ref="editor")
    for tag in ("TreeNodesModel", "MetadataFields"):  # editors write these
        _add(inside, "element", name=tag, type="xs:anyType")
    _add_attributes(content, "xs:string", "BTCPP_format", use="required", fixed="4")
    _add_attributes(content, "value.name", "main_tree_to_execute")
    _add_attributes(content, "xs:string", "project_name")
    _add(content, "attributeGroup", ref="editor")
    once = _add(root, "unique", name="tree")
    _add(once, "selector", xpath="BehaviorTree")
    _add(once, "field", xpath="@ID")


def _add_subtree(schema: ET.Element) -> None:
    content = _add(schema, "complexType", name="node.SubTree")
    _document(content, "Another tree of the file, with separate variables.")
    _add_attributes(content, "value.name", "ID", use="required")
    _add_attributes(content, "value.boolean", "_autoremap")
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
    is_choice = port.type is str and port.choices
    if port.direction == "input" and (is_choice or port.range):
        union = _add(_add(attribute, "simpleType"), "union", memberTypes="value.reference")
        if is_choice:
            _add_restriction(union, "xs:string", "enumeration", map(str, port.choices))
            return
        base = "xs:integer" if port.type is int else "xs:double"
        number = _add_restriction(union, base, "pattern", [_PATTERNS[port.type]])
        for facet, bound in (("minInclusive", port.least), ("maxInclusive", port.most)):
            if bound is not None:
                _add(number, facet, value=f"{bound:g}")
    elif port.direction == "input" and port.type in {str, object}:
        attribute.set("type", "xs:string")
    elif port.direction == "input" and port.type in _NAMES:
        attribute.set("type", f"port.{_NAMES[port.type]}")
    else:
        attribute.set("type", "value.reference")  # an output, or of a type without literals


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
    _add_restriction(which, "xs:string", "enumeration", ids)
    _add(content, "attributeGroup", ref="common")
    _add(content, "anyAttribute", processContents="skip")
