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

from uav_bt.tree.describe import NodeInfo, describe
from uav_bt.tree.loading.elements import EDITOR_ATTRIBUTES
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.models import ENUMERATION, MEMBER, PORT_DIRECTIONS
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES, PORT_TYPES, REFERENCE_KEY, Port, port_text
from uav_bt.tree.registry import NodeRegistry

_TAG: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")
_KIND_TAGS: Final = tuple(kind.value for kind in NodeKind)
_EXPLICIT: Final = (NodeKind.ACTION, NodeKind.CONDITION, NodeKind.CONTROL, NodeKind.DECORATOR)

_NAMES: Final[dict[type, str]] = {int: "integer", float: "number", bool: "boolean"}
_REFERENCE: Final = rf"\{{\s*@?({REFERENCE_KEY})\s*\}}"


def schema_xml(registry: NodeRegistry) -> str:
    """Return a schema of the tree files that can be composed of a registry's nodes."""
    schema = ET.Element(
        "xs:schema",
        {"xmlns:xs": "http://www.w3.org/2001/XMLSchema", "elementFormDefault": "qualified"},
    )
    nodes = [registry[node_id] for node_id in registry if node_id not in _KIND_TAGS]
    for add in (_add_values, _add_attribute_groups, _add_root, _add_models):
        add(schema)
    described = {name: one for name, one in Lookup().described.items() if name not in registry}
    _add_group(schema, [*(node.node_id for node in nodes), *described])
    for node in nodes:
        if _TAG.fullmatch(node.node_id):
            _add_node(schema, node)
    for model in described.values():
        _add_described(schema, model)
    for kind in _EXPLICIT:
        _add_explicit(schema, kind, [node.node_id for node in nodes if node.kind is kind])
    _add_subtree(schema)
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


def _add_attribute(parent: ET.Element, name: str, type_: str, *, required: bool = False) -> None:
    use = "required" if required else "optional"
    _add(parent, "attribute", name=name, type=type_, use=use)


# --- what all files have in common ----------------------------------------------------------------


def _add_values(schema: ET.Element) -> None:
    # Of a token, blanks at both ends do not count, as the loader has it.
    _add_restriction(schema, "xs:token", "pattern", [_REFERENCE], name="value.reference")
    for type_, name in _NAMES.items():
        pattern = PORT_TYPES[type_].pattern or ""
        _add_restriction(schema, "xs:token", "pattern", [pattern], name=f"value.{name}")
        either = _add(schema, "simpleType", name=f"port.{name}")
        _add(either, "union", memberTypes=f"value.{name} value.reference")
    _add_restriction(schema, "xs:string", "minLength", ["1"], name="value.name")


def _add_attribute_groups(schema: ET.Element) -> None:
    editors = _add(schema, "attributeGroup", name="editor")
    for name in sorted(EDITOR_ATTRIBUTES):
        _add_attribute(editors, name, "xs:string")
    common = _add(schema, "attributeGroup", name="common")
    for name in ("name", *sorted(CONDITION_ATTRIBUTES)):
        _add_attribute(common, name, "xs:string")
    _add(common, "attributeGroup", ref="editor")


def _add_root(schema: ET.Element) -> None:
    root = _add(schema, "element", name="root")
    content = _add(root, "complexType")
    parts = _add(content, "choice", minOccurs="0", maxOccurs="unbounded")
    include = _add(_add(parts, "element", name="include"), "complexType")
    _add_attribute(include, "path", "value.name", required=True)
    tree = _add(_add(parts, "element", name="BehaviorTree"), "complexType")
    _add(tree, "group", ref="node")
    _add_attribute(tree, "ID", "value.name", required=True)
    _add(tree, "attributeGroup", ref="editor")
    _add(parts, "element", name="TreeNodesModel", type="models")
    _add(parts, "element", name="MetadataFields", type="xs:anyType")
    _add(content, "attribute", name="BTCPP_format", type="xs:string", use="required", fixed="4")
    _add_attribute(content, "main_tree_to_execute", "value.name")
    _add_attribute(content, "project_name", "xs:string")
    _add(content, "attributeGroup", ref="editor")
    once = _add(root, "unique", name="tree")
    _add(once, "selector", xpath="BehaviorTree")
    _add(once, "field", xpath="@ID")


def _add_models(schema: ET.Element) -> None:
    port = _add(schema, "complexType", name="model.port")
    text = _add(_add(port, "simpleContent"), "extension", base="xs:string")
    _add_attribute(text, "name", "value.name", required=True)
    for name in ("type", "default"):
        _add_attribute(text, name, "xs:string")
    _add(text, "attributeGroup", ref="editor")
    model = _add(schema, "complexType", name="model")
    parts = _add(model, "choice", minOccurs="0", maxOccurs="unbounded")
    for tag in PORT_DIRECTIONS:
        _add(parts, "element", name=tag, type="model.port")
    for tag in ("description", "MetadataFields"):
        _add(parts, "element", name=tag, type="xs:anyType")
    _add_attribute(model, "ID", "value.name", required=True)
    _add_attribute(model, "editable", "xs:string")
    _add(model, "attributeGroup", ref="editor")
    models = _add(schema, "complexType", name="models")
    kinds = _add(models, "choice", minOccurs="0", maxOccurs="unbounded")
    for tag in _KIND_TAGS:
        _add(kinds, "element", name=tag, type="model")
    enumeration = _add(_add(kinds, "element", name=ENUMERATION), "complexType")
    members = _add(enumeration, "sequence", minOccurs="0", maxOccurs="unbounded")
    member = _add(_add(members, "element", name=MEMBER), "complexType")
    _add_attribute(member, "name", "value.name", required=True)
    _add_attribute(member, "value", "xs:integer", required=True)
    _add_attribute(enumeration, "ID", "value.name")
    _add(models, "attributeGroup", ref="editor")


# --- the nodes ------------------------------------------------------------------------------------


def _add_group(schema: ET.Element, node_ids: Iterable[str]) -> None:
    choice = _add(_add(schema, "group", name="node"), "choice")
    for tag in (*filter(_TAG.fullmatch, node_ids), *_KIND_TAGS):
        _add(choice, "element", name=tag, type=f"node.{tag}")


def _add_node(schema: ET.Element, node: type[Node]) -> None:
    content = _add(schema, "complexType", name=f"node.{node.node_id}")
    info = describe(node)
    _document(content, _documentation(info))
    if node.max_children != 0:
        most = "unbounded" if node.max_children is None else str(node.max_children)
        _add(content, "group", ref="node", minOccurs=str(node.min_children), maxOccurs=most)
    for port in node.ports:
        _add_port(content, port)
    _add(content, "attributeGroup", ref="common")


def _documentation(info: NodeInfo) -> str:
    keys = [("Reads", info.reads), ("Writes", info.writes)]
    lists = [f"{word} {', '.join(names)}." for word, names in keys if names]
    return " ".join([info.doc, *lists])


def _add_port(content: ET.Element, port: Port[Any]) -> None:
    use = "required" if port.required else "optional"
    attribute = _add(content, "attribute", name=port.name, use=use)
    is_given = port.default is Port.REQUIRED
    default = "" if is_given else f"default: {port_text(port.default)}"
    _document(attribute, "; ".join(text for text in (port.doc, port.range, default) if text))
    if port.direction != "input":
        attribute.set("type", "value.reference")
    elif port.type is str and port.choices:
        either = _add(attribute, "simpleType")
        union = _add(either, "union", memberTypes="value.reference")
        _add_restriction(union, "xs:string", "enumeration", map(str, port.choices))
    elif port.range:
        union = _add(_add(attribute, "simpleType"), "union", memberTypes="value.reference")
        base = "xs:integer" if port.type is int else "xs:double"
        pattern = PORT_TYPES[port.type].pattern or ""
        number = _add_restriction(union, base, "pattern", [pattern])
        for facet, bound in (("minInclusive", port.least), ("maxInclusive", port.most)):
            if bound is not None:
                _add(number, facet, value=f"{bound:g}")
    elif port.type in _NAMES:
        attribute.set("type", f"port.{_NAMES[port.type]}")
    elif port.type in {str, object}:
        attribute.set("type", "xs:string")
    else:
        attribute.set("type", "value.reference")  # of such a type there are no literals


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


def _add_subtree(schema: ET.Element) -> None:
    content = _add(schema, "complexType", name="node.SubTree")
    _document(content, "Another tree of the file, with separate variables.")
    _add_attribute(content, "ID", "value.name", required=True)
    _add_attribute(content, "_autoremap", "value.boolean")
    _add(content, "attributeGroup", ref="common")
    _add(content, "anyAttribute", processContents="skip")
