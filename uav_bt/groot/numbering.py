"""Numbers of a tree's nodes and names of its subtrees, and the numbered tree as XML for Groot2."""

from __future__ import annotations

import re
from typing import Final, NamedTuple
from xml.etree import ElementTree as ET

from uav_bt.errors import InputError
from uav_bt.tree import MissionTree, Node
from uav_bt.tree.describe import add_model
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.port import port_text

MAX_UID: Final = 0xFFFF  # a uid has two bytes


class TreeInstance(NamedTuple):
    """One use of a tree of the file; a tree that is used twice has two instances."""

    tree_id: str
    full_path: str  # names of the outer instances and of this one; empty for the main tree
    root: Node

    @property
    def board_name(self) -> str:
        """The name of this instance's blackboard in the protocol."""
        return self.full_path or self.tree_id


class TreeNumbering:
    """Numbers of a tree's nodes, from 1, parents first, in the order of the file.

    Attributes:
        nodes: all nodes; the tree must not change.
        uids: their numbers, by path.
        full_paths: names of the instances, by path of the SubTree node.
        instances: the main tree, and all others in the order of the file.
    """

    def __init__(self, tree: MissionTree) -> None:
        self.nodes = tuple(tree.nodes())
        if len(self.nodes) > MAX_UID:
            raise InputError(
                f"tree '{tree.name}' has {len(self.nodes)} nodes; at most {MAX_UID} can be numbered"
            )
        self.uids = {node.path: uid for uid, node in enumerate(self.nodes, 1)}
        self.full_paths: dict[str, str] = {}
        self.instances = [TreeInstance(tree.name, "", tree.root)]
        for node in self.nodes:
            if isinstance(node, SubTree):
                full_path = self.full_paths[node.path] = self._name(node)
                self.instances.append(TreeInstance(node.tree_id, full_path, node.child))

    def _name(self, node: SubTree) -> str:
        outer = node.parent
        while outer is not None and not isinstance(outer, SubTree):
            outer = outer.parent
        full_path = node.name if outer is None else f"{self.full_paths[outer.path]}/{node.name}"
        # BehaviorTree.CPP numbers an unnamed instance. Here unnamed means that name and id are
        # equal. A name used twice is numbered, too, because the paths name the blackboards.
        if node.name == node.tree_id or full_path in self.full_paths.values():
            return f"{full_path}::{self.uids[node.path]}"
        return full_path


# Characters that XML cannot contain; a node composed in Python may have them in its name.
_UNWRITABLE: Final = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def tree_xml(numbering: TreeNumbering) -> str:
    """Return a numbered tree as XML for Groot2.

    Each instance of a tree is a separate `BehaviorTree` with its `_fullpath`, which the `SubTree`
    node has, too. All nodes have their `_uid`. The `TreeNodesModel` describes the node classes in
    use.
    """
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=numbering.instances[0].tree_id)
    for instance in numbering.instances:
        names = {"ID": instance.tree_id, "_fullpath": instance.full_path}
        _add_node(_added(root, "BehaviorTree", names), instance.root, numbering)
    model = ET.SubElement(root, "TreeNodesModel")
    classes = {node.node_id: type(node) for node in numbering.nodes}
    for node_id in sorted(classes):
        if not issubclass(classes[node_id], SubTree):  # subtrees need no description
            add_model(model, classes[node_id])
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_node(parent: ET.Element, node: Node, numbering: TreeNumbering) -> None:
    subtree = node if isinstance(node, SubTree) else None
    names = {"name": node.name}
    if subtree is not None:
        names = {"ID": subtree.tree_id, **names, "_fullpath": numbering.full_paths[node.path]}
    names["_uid"] = str(numbering.uids[node.path])
    tag = node.node_id if subtree is None else SubTree.node_id
    element = _added(parent, tag, names | _attributes(node))
    for child in node.children if subtree is None else ():
        _add_node(element, child, numbering)


def _added(parent: ET.Element, tag: str, attributes: dict[str, str]) -> ET.Element:
    attributes = {name: _UNWRITABLE.sub("\ufffd", text) for name, text in attributes.items()}
    return ET.SubElement(parent, tag, attributes)


def _attributes(node: Node) -> dict[str, str]:
    """Return the attributes of a node in a tree file, including defaults."""
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
