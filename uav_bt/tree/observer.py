"""Watching a tree from outside: what each node does, as it does it.

The watched nodes get wrappers around their own methods, each node by itself, so that a tree which
nobody watches ticks exactly as it always does.
"""

from __future__ import annotations

import enum
from collections.abc import Callable

from uav_bt.errors import NodeFailedError
from uav_bt.tree import Leaf, MissionTree, Node, Status
from uav_bt.tree.status import FAILURE, RUNNING, SUCCESS

__all__ = ["Happening", "Listener", "watch_nodes"]


class Happening(enum.Enum):
    """What can happen to a node."""

    STARTED = "started"  # ticked for the first time of an activation
    RAN = "ran"  # ticked again
    SUCCEEDED = "succeeded"  # answered SUCCESS, a `_successIf` included
    FAILED = "failed"  # answered FAILURE, a `_failureIf` included
    SKIPPED = "skipped"  # was passed over, by itself or by a condition
    HALTED = "halted"  # was stopped while it ran
    RAISED = "raised"  # an exception came out of it


Listener = Callable[[Node, Happening], None]
"""Called with each happening, in the order in which they happen."""

_ANSWERS = {SUCCESS: Happening.SUCCEEDED, FAILURE: Happening.FAILED}


def watch_nodes(tree: MissionTree, listener: Listener) -> None:
    """Tell a listener from now on what happens to each node of a tree."""
    for node in tree.nodes():
        _Watched(node, listener)


class _Watched:
    """A node's own methods, and those that take their place."""

    def __init__(self, node: Node, listener: Listener) -> None:
        self._node = node
        self._listener = listener
        self._own_tick = node._tick  # noqa: SLF001  # what the conditions let through
        self._execute_tick = node.execute_tick
        self._own_halt = node.halt
        for name, wrapper in (
            ("_tick", self._tick),
            ("execute_tick", self._execute),
            ("halt", self._halt),
        ):
            setattr(node, name, wrapper)

    def _tick(self) -> Status:
        node = self._node
        if node.status is RUNNING:
            self._listener(node, Happening.RAN)
        elif not _rests(node):
            self._listener(node, Happening.STARTED)
        return self._own_tick()

    def _execute(self) -> Status:
        node = self._node
        try:
            status = self._execute_tick()
        except NodeFailedError as error:
            if error.node_path == node.path:
                self._listener(node, Happening.RAISED)
            raise
        if status is not RUNNING:
            self._listener(node, _ANSWERS.get(status, Happening.SKIPPED))
        return status

    def _halt(self) -> None:
        node = self._node
        runs = node.status is RUNNING
        try:
            self._own_halt()
        finally:
            if runs:
                self._listener(node, Happening.HALTED)


def _rests(node: Node) -> bool:
    """Return whether a tick finds a finished leaf that nobody reset, which then does nothing."""
    if not isinstance(node, Leaf) or node.condition:
        return False
    return node.status is SUCCESS or node.status is FAILURE
