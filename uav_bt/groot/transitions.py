"""Status transitions, and their nine-byte records in Groot2's protocol and log files.

Source: BehaviorTree.CPP's `groot2_publisher.cpp` and `bt_file_logger_v2.cpp`. A record has six
bytes of microseconds, two of the node's uid and one of the status, little endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple, Self

from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.groot.numbering import TreeNumbering
from uav_bt.protocols import Clock
from uav_bt.tree import Node
from uav_bt.tree.observer import NodeEvent, observe, unobserve
from uav_bt.tree.status import FAILURE, IDLE, SUCCESS, Status

_RECORD: Final = struct.Struct("<IHHB")  # lower four and upper two bytes of the time, uid, status
_ROOT_UID: Final = 1


class Transition(NamedTuple):
    """A change of a node's status."""

    time_us: int  # microseconds of mission time
    uid: int
    status: Status


def pack(transitions: Iterable[Transition], first_time_us: int) -> bytes:
    """Return transitions as records, with their times since the first time."""
    times = ((time_us - first_time_us, uid, status) for time_us, uid, status in transitions)
    return b"".join(
        _RECORD.pack(since_us & 0xFFFFFFFF, since_us >> 32, uid, status.value)
        for since_us, uid, status in times
    )


class TransitionRecorder:
    """Records the transitions of a tree until `detach`.

    They come when they happen, in the order of BehaviorTree.CPP's loggers. A node that starts and
    ends in one tick gives a RUNNING (if it has one), a result and an IDLE. SKIPPED gives no
    transition: it is an answer, not a status of a node.
    """

    def __init__(self, numbering: TreeNumbering, clock: Clock) -> None:
        self._numbering = numbering
        self._clock = clock
        self._noted: list[Transition] = []
        self._root_ended = False
        observe(numbering.nodes, self._note)

    def detach(self) -> None:
        """Stop recording; `take` still returns recorded transitions. Safe to call twice."""
        unobserve(self._numbering.nodes, self._note)

    def take(self) -> list[Transition]:
        """Return the transitions since the last call; call after each tick and at the end.

        In BehaviorTree.CPP a finished root is idle after its tick, but here trees reset it at the
        next tick. This method keeps the order of BehaviorTree.CPP.
        """
        status = self._numbering.nodes[0].node_status
        if not self._root_ended and (status is SUCCESS or status is FAILURE):
            self._add(_ROOT_UID, IDLE)
            self._root_ended = True
        noted, self._noted = self._noted, []
        return noted

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is not NodeEvent.STATUS:
            return
        uid = self._numbering.uids[node.path]
        if uid == _ROOT_UID:
            reset, self._root_ended = self._root_ended, False
            if reset and node.node_status is IDLE:
                return  # `take` has recorded it after the tick
        self._add(uid, node.node_status)

    def _add(self, uid: int, status: Status) -> None:
        self._noted.append(Transition(round(self._clock.now() * 1e6), uid, status))


SUFFIX: Final = ".btlog"  # the only suffix that Groot2 opens

_MAGIC: Final = b"BTCPP4-FileLogger2\x01"


class BtlogWriter:
    """Writes a log during a flight. Use it as a context manager.

    Each `write` reaches the operating system, so that an interrupted mission leaves a log. A full
    disk ends the log, not the mission; the end of the context then raises the error. An existing
    file is replaced, not before `begin`.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix != SUFFIX:
            raise FileError(path, f"Groot2 opens only files named *{SUFFIX}; choose such a name")
        self._path = path
        self._first_time_us = 0
        self._fault: FileError | None = None
        self._file: BinaryIO | None = None

    def begin(self, xml: str, first_time_us: int) -> None:
        """Open the file and write its head: the numbered tree, and the mission time."""
        if self._file is not None:
            raise FileError(self._path, "this log has begun already; write another file")
        with writing(self._path):
            self._file = self._path.open("wb", buffering=0)
        self._first_time_us = first_time_us
        data = xml.encode()
        self._put(_MAGIC + struct.pack("<i", len(data)) + data + struct.pack("<q", first_time_us))

    def write(self, transitions: Iterable[Transition]) -> None:
        """Append transitions, in the order of their times."""
        self._put(pack(transitions, self._first_time_us))

    def _put(self, data: bytes) -> None:
        if self._file is None or self._fault is not None:
            return
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._fault = FileError(self._path, f"the log ends early: {error.strerror}")

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Close the file; an earlier exception has priority over an error of the log."""
        if self._file is not None:
            self._file.close()
        if self._fault is not None and error is None:
            raise self._fault
        if self._fault is not None and error is not None:
            error.add_note(str(self._fault))
