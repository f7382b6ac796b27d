"""What stands in the shipped trees that nodes are made of."""

from __future__ import annotations

from uav_bt.tree.expanded import ExpandedNode
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.elements import node_id_of, tree_within
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.source import walk
from uav_bt.tree.registry import NodeRegistry


def leaves_of(node: type[ExpandedNode], registry: NodeRegistry) -> tuple[type[Leaf], ...]:
    """Return the classes of the leaves in all shipped trees that a node can be made of.

    Args:
        node: the class.
        registry: the nodes that may occur in these trees; unknown ones are left out.
    """
    trees = Lookup().shipped.trees
    leaves: dict[type[Leaf], None] = {}
    seen: set[str] = set()
    waiting = [*node.tree_ids()]
    while waiting:
        tree_id = waiting.pop(0)
        if tree_id in seen or tree_id not in trees:
            continue
        seen.add(tree_id)
        for element in walk(trees[tree_id][0][0]):
            inner = tree_within(element, registry)
            waiting += [] if inner is None else [inner]
            leaf = registry.get(node_id_of(element))
            if leaf is not None and issubclass(leaf, Leaf):
                leaves[leaf] = None
    return tuple(leaves)
