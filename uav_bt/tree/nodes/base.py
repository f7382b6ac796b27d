"""Nodes with children: the bases of control nodes and decorators, and the subtree."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import ClassVar

from uav_bt.errors import InputError
from uav_bt.tree.flow import as_child
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import INTEGER, MAX_INTEGER, REAL, Port, parse_reference, port_text
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.tree.variables import Variables


class ControlNode(Node):
    """A node with children, ticked in some order."""

    kind = NodeKind.CONTROL
    min_children = 1
    max_children: ClassVar[int | None] = None

    def _restart(self) -> None:
        """Stop the children, and forget how far the node was."""
        for child in self.children:
            child.reset()

    def _halt(self) -> None:
        self._restart()
        self.set_status(IDLE)


class DecoratorNode(Node):
    """A node with one child."""

    kind = NodeKind.DECORATOR
    min_children = 1
    max_children = 1

    def __init__(self, name: str | None, child: Node, /, **given: object) -> None:
        super().__init__(name, (child,), **given)
        self.child = child

    def execute_tick(self) -> Status:
        """Tick once; a child that finished is reset, so that it can start again."""
        status = super().execute_tick()
        child = self.child
        if child.node_status is SUCCESS or child.node_status is FAILURE:
            child.set_status(IDLE)
        return status


def entry_value(text: str) -> int | float | str:
    """Return the value of a SubTree's entry as engine 4.10 does: a number or a text."""
    if re.fullmatch(INTEGER, text) and -MAX_INTEGER <= int(text) < MAX_INTEGER:
        return int(text)
    if re.fullmatch(REAL, text) and math.isfinite(float(text)):
        return float(text)
    return text


class SubTree(DecoratorNode):
    """Another tree of the file, with separate variables.

    Args:
        name: the instance's name.
        child: the root of the other tree.
        entries: the inner tree's variables by name: `{outer}` shares the outer tree's variable,
            `{@key}` is a key of the mission board, anything else is the variable's first value: a
            number, or a text.
        autoremap: all variables that are not private (`_x`) are the outer tree's.
        tree_id: the other tree's id in its file; default: the instance's name.
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
        tree_id: str = "",
        **conditions: object,
    ) -> None:
        super().__init__(name, child, **conditions)
        self.tree_id = tree_id or self.name
        self.autoremap = autoremap
        self._take_entries(dict(entries or {}))

    @property
    def attributes(self) -> dict[str, str]:
        """The entries as a tree file has them, for those who write one."""
        return {**self._entries, **({"_autoremap": "true"} if self.autoremap else {})}

    def _take_entries(self, entries: dict[str, str]) -> None:
        self._entries = entries
        self.shared: dict[str, str] = {}  # names outside, by those inside
        self.board_keys: dict[str, str] = {}
        self.constants: dict[str, int | float | str] = {}
        for inner, text in entries.items():
            reference = parse_reference(text, inner)
            if reference is None:
                self.constants[inner] = entry_value(text)
            else:
                outside = self.board_keys if reference.on_board else self.shared
                outside[inner] = reference.key

    def rebind(self, given: Mapping[str, object]) -> None:
        """Replace entries by name, before the setup."""
        try:
            self._take_entries(
                {**self._entries, **{name: port_text(value) for name, value in given.items()}}
            )
        except ValueError as error:
            raise InputError(f"SubTree '{self.name}': {error}") from error
        self.place(self.path, self.variables)

    variables_after = as_child

    def open_scope(self, outer: Variables) -> Variables:
        """Return the variables of the tree inside; `outer` are those that the node stands in."""
        return Variables(
            outer,
            self.shared,
            board=self.board_keys,
            constants=self.constants,
            autoremap=self.autoremap,
        )

    def update(self) -> Status:
        """Tick the child."""
        if self.node_status is IDLE:
            self.set_status(RUNNING)
        return self.child.execute_tick()
