"""State of a tree for Groot2 clients, passed from the ticking thread to the answering thread.

The ticking thread replaces whole values and appends to a bounded queue, without locks or waits. A
request during a tick gets the state at the end of the tick before.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Final
from uuid import UUID, uuid4

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.plain_values import plain
from uav_bt.groot.groot_protocol import ProtocolError, Request, RequestType
from uav_bt.groot.numbering import TreeNumbering, tree_xml
from uav_bt.groot.transitions import NEWLY_IDLE, Transition, pack
from uav_bt.tree.status import Status

# Number of transitions kept between two requests of a recording client. Older ones are lost, as in
# BehaviorTree.CPP, which keeps a thousand.
MAX_RECORDED: Final = 10_000
_ENTRY: Final = struct.Struct("<HB")  # uid, status


class GrootView:
    """State of one tree in the format of the protocol.

    Args:
        numbering: numbering of the tree.
        board: board of the mission, shown with the main tree's variables as `@key`.
        now_us: mission time, microseconds.
        tree_id: id by which clients recognise the same tree; default: a new one.
    """

    def __init__(
        self,
        numbering: TreeNumbering,
        board: Blackboard,
        *,
        now_us: int = 0,
        tree_id: UUID | None = None,
    ) -> None:
        self.tree_id = tree_id or uuid4()
        self._instances = numbering.instances
        self._board = board
        self._xml = tree_xml(numbering).encode()
        self._codes = [node.node_status.value for node in numbering.nodes]
        entries = (_ENTRY.pack(uid, code) for uid, code in enumerate(self._codes, 1))
        self._table = bytearray(b"".join(entries))
        self._now_us = now_us
        self._recording = False
        self._recorded_from_us = 0
        self._recorded: deque[Transition] = deque(maxlen=MAX_RECORDED)
        self._statuses = bytes(self._table)
        self._values = self._snapshot()

    # --- the ticking thread -----------------------------------------------------------------------

    def update(self, transitions: Iterable[Transition], now_us: int) -> None:
        """Add the changes of a tick.

        Args:
            transitions: all transitions of the tick.
            now_us: mission time, microseconds.
        """
        recording = self._recording
        for transition in transitions:
            place = transition.uid - 1
            code = transition.status.value
            if transition.status is Status.IDLE:
                code = NEWLY_IDLE + self._codes[place]
            self._codes[place] = transition.status.value
            self._table[place * _ENTRY.size + 2] = code
            if recording:
                self._recorded.append(transition)
        self._statuses = bytes(self._table)
        self._values = self._snapshot()
        self._now_us = now_us

    def _snapshot(self) -> dict[str, Mapping[str, Any]]:
        values = {item.board_name: item.variables.snapshot() for item in self._instances}
        keys = self._board.snapshot()
        main = values[self._instances[0].board_name]
        main |= {f"@{name}": value for name, (value, _) in keys.items()}
        return dict(values)

    # --- the answering thread ---------------------------------------------------------------------

    def answer(self, request: Request) -> bytes | None:
        """Return the second frame of the answer; None without content.

        Raises:
            ProtocolError: the request cannot be answered.
        """
        match request.type:
            case RequestType.FULL_TREE:
                return self._xml
            case RequestType.STATUS:
                return self._statuses
            case RequestType.BLACKBOARD:
                return self._blackboards(request.text())
            case RequestType.TOGGLE_RECORDING:
                return self._toggle(request.text())
            case RequestType.GET_TRANSITIONS:
                return self._transitions()
        raise ProtocolError(
            f"not supported: this tree can be watched, not changed (request '{request.type.value}')"
        )

    def _blackboards(self, names: str) -> bytes:
        import msgpack  # noqa: PLC0415  # of the extra `live`

        values = self._values
        wanted = [name for name in names.split(";") if name in values]
        dump = {name: plain(values[name]) for name in wanted}
        packed: bytes = msgpack.packb(dump)
        return packed

    def _toggle(self, word: str) -> bytes | None:
        if word == "start":
            self._recorded.clear()
            self._recorded_from_us = self._now_us
            self._recording = True
            return str(self._now_us).encode()
        if word == "stop":
            self._recording = False
            return None
        raise ProtocolError(f"recording is switched by 'start' or 'stop', got '{word:.40}'")

    def _transitions(self) -> bytes:
        # Only the present entries, because the other thread continues to append.
        taken = [self._recorded.popleft() for _ in range(len(self._recorded))]
        return pack(taken, self._recorded_from_us)
