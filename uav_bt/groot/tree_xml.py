"""A tree as XML with the number of each node, and a model of its nodes."""

from __future__ import annotations

import re
from typing import Final
from xml.etree import ElementTree as ET

from uav_bt.groot.numbering import TreeInstance, TreeNumbering
from uav_bt.tree import Node
from uav_bt.tree.describe import add_model
from uav_bt.tree.nodes.subtree import SubTree
from uav_bt.tree.port import port_text

# XML cannot write these; a node composed in Python may be named with them.
_UNWRITABLE: Final = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def tree_xml(numbering: TreeNumbering) -> str:
    """Return a numbered tree as Groot2 reads it.

    Every instance of a tree stands alone, as a `BehaviorTree` with its `_fullpath`; a `SubTree`
    node names the instance by the same. All nodes have their `_uid`. The `TreeNodesModel` describes
    the classes of the nodes that occur.
    """
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=numbering.instances[0].tree_id)
    for instance in numbering.instances:
        _add_instance(root, instance, numbering)
    model = ET.SubElement(root, "TreeNodesModel")
    classes = {node.node_id: type(node) for node in numbering.nodes}
    for node_id in sorted(classes):
        if not issubclass(classes[node_id], SubTree):  # described by the trees themselves
            add_model(model, classes[node_id])
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_instance(root: ET.Element, instance: TreeInstance, numbering: TreeNumbering) -> None:
    tree = ET.SubElement(
        root,
        "BehaviorTree",
        ID=_writable(instance.tree_id),
        _fullpath=_writable(instance.full_path),
    )
    _add_node(tree, instance.root, numbering)


def _add_node(parent: ET.Element, node: Node, numbering: TreeNumbering) -> None:
    element = ET.SubElement(parent, node.node_id)
    if isinstance(node, SubTree):
        element.set("ID", _writable(node.tree_id))
        element.set("name", _writable(node.name))
        element.set("_fullpath", _writable(numbering.full_path(node)))
    else:
        element.set("name", _writable(node.name))
    element.set("_uid", str(numbering.uid(node)))
    for name, text in _attributes(node).items():
        element.set(name, _writable(text))
    if not isinstance(node, SubTree):
        for child in node.children:
            _add_node(element, child, numbering)


def _attributes(node: Node) -> dict[str, str]:
    """Return what a tree file would say about a node, defaults included."""
    attributes: dict[str, str] = {}
    for port in node.ports:
        reference = node.reference(port)
        if reference is not None:
            attributes[port.name] = str(reference)
        elif port.direction == "input":
            attributes[port.name] = port_text(node.port_value(port.name))
    if isinstance(node, SubTree):
        attributes |= node.attributes
    return attributes | node.condition_scripts


def _writable(text: str) -> str:
    return _UNWRITABLE.sub("\ufffd", text)
