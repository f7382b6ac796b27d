"""One tree file with all that a mission takes from others, for its record."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.models import ENUMERATION, MEMBER
from uav_bt.tree.loading.source import to_xml
from uav_bt.tree.node import NodeKind


def whole_file(document: Document, source: bytes) -> bytes:
    """Return the main tree with all that it uses as one file: its own where nothing is elsewhere.

    Args:
        document: the outline; the places of files are in its trees and defaults.
        source: the mission's own file.
    """
    if not document.included:
        return source
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=document.main)
    used = document.within(document.main)
    for tree_id in (document.main, *sorted(used - {document.main})):
        tree = to_xml(document.trees[tree_id])
        tree.set("ID", tree_id)
        root.append(tree)
    models = ET.SubElement(root, "TreeNodesModel")
    for tree_id in sorted(used & document.subtree_ports.keys()):
        model = ET.SubElement(models, NodeKind.SUBTREE.value, ID=tree_id)
        for name, default in document.subtree_ports[tree_id].items():
            given = {} if default is None else {"default": default}
            ET.SubElement(model, "input_port", {"name": name, **given})
    enumeration = ET.SubElement(models, ENUMERATION)
    for name, value in document.enum_members.items():
        ET.SubElement(enumeration, MEMBER, name=name, value=str(value))
    return ET.tostring(root, encoding="unicode").encode()
