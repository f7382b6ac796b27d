"""Base of the nodes that have one child."""

from __future__ import annotations

from py_trees.decorators import Decorator

from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.status import FAILURE, SUCCESS, Status

__all__ = ["DecoratorNode"]


class DecoratorNode(Node, Decorator):
    """A node with one child.

    Args:
        name: the instance's name; default: the node's id.
        child: the child.
        given: values of the ports.

    Raises:
        TypeError: the child is none of this package's nodes.
    """

    kind = NodeKind.DECORATOR
    min_children = 1
    max_children = 1

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        if not isinstance(child, Node):
            raise TypeError(f"the child of '{name or self.node_id}' must be a uav_bt.tree node")
        Decorator.__init__(self, name or self.node_id, child)
        self._bind(given)
        self.child = child

    def execute_tick(self) -> Status:
        """Tick once; a child that finished is reset, so that it can start again.

        Raises:
            NodeFailedError: an exception came out of this node or of one below it.
        """
        status = super().execute_tick()
        child = self.child
        if child.status is SUCCESS or child.status is FAILURE:
            child.status = Status.INVALID
        return status
