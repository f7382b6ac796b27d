"""A tree inside a tree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes.decorator import DecoratorNode
from uav_bt.tree.port import Port, parse_reference
from uav_bt.tree.status import IDLE, RUNNING, Status
from uav_bt.tree.variables import Variables

__all__ = ["SubTree"]


class SubTree(DecoratorNode):
    """Another tree of the file, with variables of its own.

    Args:
        name: the instance's name.
        child: the root of the other tree.
        entries: the inner tree's variables by name: `{outer}` shares the outer tree's variable, any
            other text is the variable's first value.
        autoremap: all variables that are not private (`_x`) are the outer tree's.
    """

    node_id = "SubTree"
    kind = NodeKind.SUBTREE

    AUTOREMAP: ClassVar = Port(
        "autoremap", bool, default=False, doc="share all variables that are not private (_x)"
    )

    def __init__(
        self,
        name: str | None,
        child: Node,
        /,
        entries: Mapping[str, str] | None = None,
        *,
        autoremap: bool = False,
        **conditions: object,
    ) -> None:
        super().__init__(name, child, **conditions)
        self._autoremap = autoremap
        self._shared: dict[str, str] = {}
        self._constants: dict[str, str] = {}
        for inner, text in (entries or {}).items():
            reference = parse_reference(text, inner)
            if reference is None:
                self._constants[inner] = text
            elif not reference.on_board:
                self._shared[inner] = reference.key
            else:
                raise ValueError(
                    f"'{inner}': a tree's variable cannot be the board key {reference}; "
                    "use the key inside the subtree"
                )

    def open_scope(self, outer: Variables) -> Variables:
        """Return the scope of the tree inside."""
        inner = Variables(outer, self._shared, autoremap=self._autoremap)
        for key, text in self._constants.items():
            inner[key] = text
        return inner

    def _tick(self) -> Status:
        if self.status is IDLE:
            self.status = RUNNING
        return self.child.execute_tick()
