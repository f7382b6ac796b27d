"""Numbers for the nodes of a tree, and names for the trees inside it, as the engine gives them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from uav_bt.errors import InputError
from uav_bt.tree import MissionTree, Node, Variables
from uav_bt.tree.nodes.subtree import SubTree

MAX_UID: Final = 0xFFFF  # a uid has two bytes


@dataclass(frozen=True, kw_only=True)
class TreeInstance:
    """One tree of a tree file in its place; a tree that is used twice has two of them."""

    tree_id: str
    full_path: str  # of the instances around it and its own name; empty for the main tree
    root: Node
    variables: Variables

    @property
    def board_name(self) -> str:
        """What the protocol calls this instance's blackboard."""
        return self.full_path or self.tree_id


class TreeNumbering:
    """The nodes of a tree by number, from 1, parents first, in the order of the file.

    Args:
        tree: the tree; it must not be changed afterwards.

    Raises:
        InputError: it has more nodes than there are numbers.
    """

    def __init__(self, tree: MissionTree) -> None:
        self.nodes = tuple(tree.nodes())
        if len(self.nodes) > MAX_UID:
            raise InputError(
                f"tree '{tree.name}' has {len(self.nodes)} nodes; at most {MAX_UID} can be numbered"
            )
        self._uids = {node.path: uid for uid, node in enumerate(self.nodes, 1)}
        self._full_paths: dict[str, str] = {}
        main = TreeInstance(
            tree_id=tree.name, full_path="", root=tree.root, variables=tree.variables
        )
        self.instances = (main, *self._instances_below(tree.root, ""))

    def uid(self, node: Node) -> int:
        """Return a node's number."""
        return self._uids[node.path]

    def full_path(self, subtree: SubTree) -> str:
        """Return the full path of the instance that a SubTree node stands for."""
        return self._full_paths[subtree.path]

    def _instances_below(self, root: Node, outer: str) -> list[TreeInstance]:
        """Return the instances in one tree, and those in them, in the order of the file."""
        instances: list[TreeInstance] = []
        stack = [root]
        while stack:
            node = stack.pop()
            if not isinstance(node, SubTree):
                stack.extend(reversed(node.children))
                continue
            full_path = self._name(node, outer)
            self._full_paths[node.path] = full_path
            instances.append(
                TreeInstance(
                    tree_id=node.tree_id,
                    full_path=full_path,
                    root=node.child,
                    variables=node.child.variables,
                )
            )
            instances += self._instances_below(node.child, full_path)
        return instances

    def _name(self, node: SubTree, outer: str) -> str:
        prefix = f"{outer}/" if outer else ""
        full_path = f"{prefix}{node.name}"
        # The engine numbers an unnamed instance; of ours only is known whether name and
        # id agree. A name used twice is numbered, too: the paths are the blackboards' names.
        if node.name == node.tree_id or full_path in self._full_paths.values():
            return f"{prefix}{node.name}::{self.uid(node)}"
        return full_path
