"""Nodes that are made of a tree file: the class that authors of such nodes subclass."""

from __future__ import annotations

from uav_bt.tree.expanded import ExpandedNode
from uav_bt.tree.loading.loader import load_shipped_tree
from uav_bt.tree.node import Node
from uav_bt.tree.port import bind_ports


class SubtreeNode(ExpandedNode):
    """A node with typed ports that is made of a tree of `trees/lib/`.

        class ReturnToBase(SubtreeNode):
            \"\"\"Search for the landing mark and fly to it; SUCCESS above it.\"\"\"

            ports = (
                Port("policy", str, default="segmentation", doc="..."),
                Port("gives_way", bool, default=False, doc="..."),
                Port("approach", str, default="memory", choices=("memory", "policy"), doc="..."),
            )
            variants = {("approach", "policy"): "ReturnToBaseByPolicy"}

    The class says which ports there are, with type, default and description; it has no code. The
    tree has the node's id: `<BehaviorTree ID="ReturnToBase">`. `variants` has the ID of another
    tree for a value of a port; that port takes literals only. All other ports are entries of the
    tree: nodes inside read them as `policy="{policy}"`, and scripts as `gives_way`.

    Register the class as any other node class, and put the tree into a file of `trees/lib/`. A
    tree file then has `<ReturnToBase policy="corridor"/>`, or by its kind
    `<SubTree ID="ReturnToBase" policy="corridor"/>`. A tree of that ID in the mission's own file,
    or else in a folder of `--trees`, takes the place of the one in `trees/lib/`.

    In Python `ReturnToBase(policy="corridor")` makes the node with the tree of `trees/lib/`.

    Args:
        name: the instance's name; default: the node's id.
        child: the root of the tree; default: that of the tree in `trees/lib/`.
        given: values of the ports, typed or as texts; a text in braces is a reference.

    Raises:
        InputError: a port is missing, unknown or has a value of another type.
        UnknownNameError: `trees/lib/` has no such tree.
    """

    def __init__(
        self, name: str | None = None, child: Node | None = None, /, **given: object
    ) -> None:
        if child is None:
            bound, _ = bind_ports(self.ports, given)  # the base class refuses a wrong one
            child = load_shipped_tree(self.tree_of(bound))
        super().__init__(name, child, **given)
