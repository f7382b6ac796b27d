"""A tick as py_trees' visitors see it: node by node, each with what its tick answered."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from uav_bt.tree.observer import NodeEvent, observe, unobserve
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status

if TYPE_CHECKING:
    from uav_bt.tree.node import Node

_ANSWERS: Final = {
    NodeEvent.CONTINUES: RUNNING,
    NodeEvent.SUCCEEDED: SUCCESS,
    NodeEvent.FAILED: FAILURE,
    NodeEvent.SKIPPED: SKIPPED,
}


def visited_tick(node: Node) -> Iterator[Node]:
    """Tick a node, and yield every node that was ticked, children first.

    Each shows the status that its tick answered while it is being visited.

    Args:
        node: the uppermost one that is ticked.
    """
    if node.node_status is SUCCESS or node.node_status is FAILURE:
        node.reset()
    visits: list[tuple[Node, Status]] = []

    def note(ticked: Node, event: NodeEvent) -> None:
        if event in _ANSWERS:
            visits.append((ticked, _ANSWERS[event]))

    nodes = list(node.iterate())
    observe(nodes, note)
    try:
        node.execute_tick()
    finally:
        unobserve(nodes, note)
    for ticked, answered in visits:
        ticked.visited = answered
        try:
            yield ticked
        finally:  # py_trees' composites leave the generator here
            ticked.visited = None
