"""Base of the nodes that order their children."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite

from uav_bt.tree.node import Node, NodeKind

__all__ = ["ControlNode"]


class ControlNode(Node, Composite):
    """A node with children, ticked in some order.

    Args:
        name: the instance's name; default: the node's id.
        children: the children, in order.
        given: values of the ports.
    """

    kind = NodeKind.CONTROL
    min_children = 1
    max_children: ClassVar[int | None] = None

    def __init__(
        self, name: str | None = None, children: Iterable[Node] = (), /, **given: object
    ) -> None:
        Composite.__init__(self, name or self.node_id, list(children))
        self._bind(given)

    def add_child(self, child: Behaviour) -> uuid.UUID:
        """Append a child.

        Raises:
            TypeError: it is a py_trees behaviour, but none of this package's nodes.
        """
        if not isinstance(child, Node):
            raise TypeError(
                f"a child of '{self.name}' must be a uav_bt.tree node, got {type(child).__name__}: "
                "wrap a foreign behaviour in a Leaf"
            )
        return super().add_child(child)

    def _reset_children(self) -> None:
        for child in self.children:
            child.reset()
