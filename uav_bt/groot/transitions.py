"""Status transitions, and the nine bytes that Groot2 and its log files have for each.

Facts from BehaviorTree.CPP's `groot2_publisher.cpp` and `bt_file_logger_v2.cpp`: six bytes of
microseconds, two of the node's uid, one of the status; little endian.

`TransitionRecorder` notes them while they happen. The notes are those that the engine's own
loggers get, in their order, whatever a node does in its tick: a node that starts and ends in one
tick leaves a RUNNING (where it has one), a result and an IDLE. SKIPPED leaves nothing, as with the
engine: it is an answer, never a node's status.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

from uav_bt.errors import ValueRangeError
from uav_bt.groot.numbering import TreeNumbering
from uav_bt.protocols import Clock
from uav_bt.tree import Node
from uav_bt.tree.observer import NodeEvent, observe, unobserve
from uav_bt.tree.status import FAILURE, IDLE, SUCCESS, Status

NEWLY_IDLE: Final = 10  # added to the status that a now idle node had before

# The time's lower four bytes and its upper two, then uid and status.
_RECORD: Final = struct.Struct("<IHHB")
RECORD_BYTES: Final = _RECORD.size
MAX_TIME_US: Final = (1 << 48) - 1  # almost nine years


class Transition(NamedTuple):
    """A node's status changed."""

    time_us: int  # microseconds of the mission clock, or since a log's beginning
    uid: int
    status: Status


def pack(transitions: Iterable[Transition], first_time_us: int = 0) -> bytes:
    """Return transitions as records, nine bytes each.

    Args:
        transitions: what happened.
        first_time_us: subtracted from the times.

    Raises:
        ValueRangeError: a time lies before the first or does not fit six bytes.
    """
    records = bytearray()
    for time_us, uid, status in transitions:
        since_us = time_us - first_time_us
        if not 0 <= since_us <= MAX_TIME_US:
            raise ValueRangeError(
                f"a transition's time must lie within 0 and {MAX_TIME_US} us after the log began, "
                f"got {since_us} us"
            )
        records += _RECORD.pack(since_us & 0xFFFFFFFF, since_us >> 32, uid, status.value)
    return bytes(records)


def unpack(record: bytes) -> Transition:
    """Return the transition of one record, its time since the log's beginning.

    Raises:
        ValueRangeError: it is not nine bytes long, or there is no such status.
    """
    if len(record) != RECORD_BYTES:
        raise ValueRangeError(f"a record has {RECORD_BYTES} bytes, got {len(record)}")
    low, high, uid, status = _RECORD.unpack(record)
    try:
        return Transition(high << 32 | low, uid, Status(status))
    except ValueError:
        raise ValueRangeError(f"a status is a number from 0 to 4, got {status}") from None


_ROOT_UID: Final = 1


class TransitionRecorder:
    """Notes a tree's transitions from when it is attached until it is detached.

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

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is not NodeEvent.STATUS:
            return
        uid = self._numbering.uid(node)
        if uid == _ROOT_UID:
            reset, self._root_ended = self._root_ended, False
            if reset and node.node_status is IDLE:
                return  # `take` noted it when the tick was over
        self._noted.append((self._clock.now(), uid, node.node_status))
