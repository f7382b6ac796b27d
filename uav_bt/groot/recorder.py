"""Every change of every node's status, noted while it happens, of a tree that is watched.

The notes are those that the engine's own loggers get, in their order, whatever a node does in its
tick: a node that starts and ends in one tick leaves a RUNNING (where it has one), a result and an
IDLE. SKIPPED leaves nothing, as with the engine: it is an answer, never a status that a node stands
in.
"""

from __future__ import annotations

from types import TracebackType
from typing import Final, Self

from uav_bt.groot.numbering import TreeNumbering
from uav_bt.groot.transitions import Transition
from uav_bt.protocols import Clock
from uav_bt.tree import Node
from uav_bt.tree.observer import NodeEvent, observe, unobserve
from uav_bt.tree.status import FAILURE, IDLE, SUCCESS, Status

_ROOT_UID: Final = 1


class TransitionRecorder:
    """Notes a tree's transitions from when it is attached until it is detached.

    Use it as a context manager, or attach and detach it.

    Args:
        numbering: of the tree.
        clock: the mission's; it dates the transitions.
    """

    def __init__(self, numbering: TreeNumbering, clock: Clock) -> None:
        self._numbering = numbering
        self._clock = clock
        self._noted: list[tuple[float, int, Status]] = []  # seconds, uid; put in form by `take`
        self._root_ended = False

    def attach(self) -> None:
        """Begin to note."""
        observe(self._numbering.nodes, self._note)

    def detach(self) -> None:
        """Note no longer; what was noted can still be taken. Safe to call twice."""
        unobserve(self._numbering.nodes, self._note)

    def take(self) -> list[Transition]:
        """Return what was noted since the last call; called after a tick, and at the end.

        To the engine a root that finished is idle as soon as its tick is over, while our trees
        reset it when they are ticked again; here the engine's order is kept.
        """
        status = self._numbering.nodes[0].node_status
        if not self._root_ended and (status is SUCCESS or status is FAILURE):
            self._noted.append((self._clock.now(), _ROOT_UID, IDLE))
            self._root_ended = True
        noted, self._noted = self._noted, []
        return [Transition(round(time_s * 1e6), uid, status) for time_s, uid, status in noted]

    def __enter__(self) -> Self:
        """Attach."""
        self.attach()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Detach."""
        self.detach()

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is not NodeEvent.STATUS:
            return
        uid = self._numbering.uid(node)
        if uid == _ROOT_UID:
            reset, self._root_ended = self._root_ended, False
            if reset and node.node_status is IDLE:
                return  # `take` noted it when the tick was over
        self._noted.append((self._clock.now(), uid, node.node_status))
