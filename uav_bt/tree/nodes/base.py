"""Bases of the nodes that have children."""

from __future__ import annotations

from typing import ClassVar

from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.status import FAILURE, SUCCESS, Status


class ControlNode(Node):
    """A node with children, ticked in some order."""

    kind = NodeKind.CONTROL
    min_children = 1
    max_children: ClassVar[int | None] = None

    def _reset_children(self) -> None:
        for child in self.children:
            child.reset()


class DecoratorNode(Node):
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
        super().__init__(name, (child,), **given)
        self.child = child

    def execute_tick(self) -> Status:
        """Tick once; a child that finished is reset, so that it can start again.

        Raises:
            NodeFailedError: an exception came out of this node or of one below it.
        """
        status = super().execute_tick()
        child = self.child
        if child.node_status is SUCCESS or child.node_status is FAILURE:
            child.set_status(Status.IDLE)
        return status
