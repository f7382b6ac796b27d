"""Watching nodes: every node notifies its observers of what happens to it.

A tree that is not watched pays for one comparison a tick. Budgets, logs, Groot2 and py_trees'
visitors all watch through it, in the order in which they came.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable
from typing import Any, Final

from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS


class NodeEvent(enum.Enum):
    """What can happen to a node."""

    STARTED = "started"  # its work begins: the first tick of an activation
    RAN = "ran"  # its work goes on: a further tick
    CONTINUES = "continues"  # answered RUNNING
    SUCCEEDED = "succeeded"  # answered SUCCESS, a `_successIf` included
    FAILED = "failed"  # answered FAILURE, a `_failureIf` included
    SKIPPED = "skipped"  # answered SKIPPED, by itself or by a condition
    RAISED = "raised"  # an exception came out of it instead of an answer
    HALTING = "halting"  # is about to be stopped while it runs
    HALTED = "halted"  # was stopped while it ran
    STATUS = "status"  # `node_status` has changed


ANSWERS: Final = {
    NodeEvent.CONTINUES: RUNNING,
    NodeEvent.SUCCEEDED: SUCCESS,
    NodeEvent.FAILED: FAILURE,
    NodeEvent.SKIPPED: SKIPPED,
}
"""The answers that events report."""

Observer = Callable[[Any, NodeEvent], None]
"""Called with the node and each event as it happens."""


def observe(nodes: Iterable[Any], observer: Observer) -> None:
    """Notify an observer from now on, after those that the nodes already have."""
    for node in nodes:
        node.observers = (*node.observers, observer)


def unobserve(nodes: Iterable[Any], observer: Observer) -> None:
    """Notify an observer no longer; nodes that do not have it are left as they are."""
    for node in nodes:
        node.observers = tuple(one for one in node.observers if one != observer)
