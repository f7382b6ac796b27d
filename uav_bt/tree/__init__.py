"""The tree language: nodes, ports, registry and the loader of tree files."""

from uav_bt.tree.foreign import leaf_of as leaf_of
from uav_bt.tree.leaf import Leaf as Leaf
from uav_bt.tree.loading.loader import load_tree as load_tree
from uav_bt.tree.loading.loader import parse_tree as parse_tree
from uav_bt.tree.loading.loader import shipped_subtree as shipped_subtree
from uav_bt.tree.loading.lookup import TreeFolders as TreeFolders
from uav_bt.tree.loading.parameters import Parameters as Parameters
from uav_bt.tree.mission_tree import MissionTree as MissionTree
from uav_bt.tree.node import Node as Node
from uav_bt.tree.node import NodeKind as NodeKind
from uav_bt.tree.port import Port as Port
from uav_bt.tree.registry import NodeRegistry as NodeRegistry
from uav_bt.tree.status import Status as Status
from uav_bt.tree.variables import Variables as Variables
