"""Watching nodes: every node has one observer slot, and notifies it of what happens to the node.

The slot is empty in a tree that is not watched, which then pays for one comparison a tick. Budgets,
logs, Groot2 and py_trees' visitors all watch through it. A node that has several observers notifies
them in the order in which they came.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable
from typing import Any, Protocol


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


Observer = Callable[[Any, NodeEvent], None]
"""Called with the node and each event as it happens."""


class Observed(Protocol):
    """Anything with an observer slot. Every node has one."""

    observer: Observer | None


class _Observers(tuple[Observer, ...]):
    """Several observers in one slot."""

    __slots__ = ()

    def __call__(self, node: Observed, event: NodeEvent) -> None:
        for observer in self:
            observer(node, event)


def observe(nodes: Iterable[Observed], observer: Observer) -> None:
    """Notify an observer from now on, after those that the nodes already have."""
    for node in nodes:
        _fill(node, [*_observers(node), observer])


def unobserve(nodes: Iterable[Observed], observer: Observer) -> None:
    """Notify an observer no longer; nodes that do not have it are left as they are."""
    for node in nodes:
        _fill(node, [one for one in _observers(node) if one != observer])


def _observers(node: Observed) -> tuple[Observer, ...]:
    slot = node.observer
    if isinstance(slot, _Observers):
        return slot
    return () if slot is None else (slot,)


def _fill(node: Observed, observers: list[Observer]) -> None:
    node.observer = _Observers(observers) if len(observers) > 1 else next(iter(observers), None)
