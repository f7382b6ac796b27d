"""One tree file with all that a mission takes from others, for its record."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.models import ENUMERATION
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import NodeKind


def whole_file(document: Document, source: bytes) -> bytes:
    """Return the main tree with all that it uses as one file: its own where nothing is elsewhere.

    Args:
        document: the outline; the places of files are in its trees.
        source: the mission's own file.
    """
    if not document.included:
        return source
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=document.main)
    used = document.within(document.main)
    for tree_id in (document.main, *sorted(used - {document.main})):
        tree = _copied(document.trees[tree_id], root)
        tree.set("ID", tree_id)
    models = ET.SubElement(root, "TreeNodesModel")
    described: set[str] = set()
    for model in (model for part in document.models for model in part.children):
        node_id = model.attributes.get("ID", "")
        if model.tag == ENUMERATION:
            _copied(model, models)
        elif model.tag == NodeKind.SUBTREE.value and node_id in used - described:
            described.add(node_id)
            for port in _copied(model, models):
                default = document.subtree_ports[node_id].get(port.get("name", ""))
                if default is not None:  # with the places of files
                    port.set("default", default)
    return ET.tostring(root, encoding="unicode").encode()


def _copied(element: Element, parent: ET.Element) -> ET.Element:
    copy = ET.SubElement(parent, element.tag, element.attributes)
    for child in element.children:
        _copied(child, copy)
    return copy
