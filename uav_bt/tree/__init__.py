"""The tree language: nodes, ports, registry and the loader of tree files."""

from uav_bt.tree.foreign import leaf_of
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.loader import load_tree, parse_tree, shipped_subtree
from uav_bt.tree.loading.lookup import TreeFolders
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import Port
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.status import Status
from uav_bt.tree.variables import Variables

__all__ = [
    "Leaf",
    "MissionTree",
    "Node",
    "NodeKind",
    "NodeRegistry",
    "Parameters",
    "Port",
    "Status",
    "TreeFolders",
    "Variables",
    "leaf_of",
    "load_tree",
    "parse_tree",
    "shipped_subtree",
]
