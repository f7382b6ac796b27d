"""State of a tree for Groot2, and the answers to its requests, as bytes.

The ticking thread replaces whole values and appends to a bounded queue, without locks or waits. A
request during a tick gets the state at the end of the tick before.

Source: BehaviorTree.CPP's `groot2_protocol.h`. The first frame of a request is protocol (u8), type
(u8) and id (u32), little endian. The first frame of its answer is the same six bytes and the
16-byte id of the tree. The second frame holds the content.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable
from typing import Any, Final
from uuid import uuid4

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.plain_values import plain
from uav_bt.errors import InputError
from uav_bt.groot.numbering import TreeNumbering, tree_xml
from uav_bt.groot.transitions import Transition, pack
from uav_bt.tree.status import Status

# Number of transitions kept between two requests of a recording client. Older ones are lost, as in
# BehaviorTree.CPP, which keeps a thousand.
MAX_RECORDED: Final = 10_000
_NEWLY_IDLE: Final = 10  # added to the former status of a node that has become idle

_ENTRY: Final = struct.Struct("<HB")  # uid, status
_HEADER: Final = struct.Struct("<BBI")
_PROTOCOL: Final = 2
_CHANGING: Final = "IRDAXUN"  # requests about hooks and breakpoints


class GrootView:
    """State of one tree. The board is shown with the main tree's variables, as `@key`."""

    def __init__(self, numbering: TreeNumbering, board: Blackboard, now_us: int) -> None:
        self._tree_id = uuid4().bytes  # by which clients recognise the same tree
        self._instances = numbering.instances
        self._board = board
        self._xml = tree_xml(numbering).encode()
        self._codes = [node.node_status.value for node in numbering.nodes]
        entries = (_ENTRY.pack(uid, code) for uid, code in enumerate(self._codes, 1))
        self._table = bytearray(b"".join(entries))
        self._recording = False
        self._recorded_from_us = 0
        self._recorded: deque[Transition] = deque(maxlen=MAX_RECORDED)
        self.update((), now_us)

    # --- the ticking thread -----------------------------------------------------------------------

    def update(self, transitions: Iterable[Transition], now_us: int) -> None:
        """Add all transitions of a tick; `now_us` is the mission time, microseconds."""
        recording = self._recording
        for transition in transitions:
            place, code = transition.uid - 1, transition.status.value
            newly_idle = _NEWLY_IDLE + self._codes[place]
            self._codes[place] = code
            idle = transition.status is Status.IDLE
            self._table[place * _ENTRY.size + 2] = newly_idle if idle else code
            if recording:
                self._recorded.append(transition)
        self._statuses = bytes(self._table)
        values = {each.board_name: each.root.variables.snapshot() for each in self._instances}
        board = self._board.snapshot().items()
        values[self._instances[0].board_name] |= {f"@{key}": value for key, (value, _) in board}
        self._values = values
        self._now_us = now_us

    # --- the answering thread ---------------------------------------------------------------------

    def answer(self, frames: list[bytes]) -> list[bytes]:
        """Return the frames of the answer to a request; InputError has the reason for none."""
        if len(frames) not in {1, 2} or len(frames[0]) != _HEADER.size:
            raise InputError(
                f"expected a header of {_HEADER.size} bytes and at most one part more, "
                f"got parts of {[*map(len, frames)]} bytes"
            )
        protocol, kind, _ = _HEADER.unpack(frames[0])
        if protocol != _PROTOCOL:
            raise InputError(f"expected protocol {_PROTOCOL}, got {protocol}")
        text = frames[1].decode(errors="replace") if len(frames) == 2 else ""
        head = frames[0] + self._tree_id
        match chr(kind):
            case "T":
                return [head, self._xml]
            case "S":
                return [head, self._statuses]
            case "B":
                return [head, self._blackboards(text)]
            case "r":
                return [head, *self._toggle(text)]
            case "t":
                # Only the present entries, because the other thread continues to append.
                taken = [self._recorded.popleft() for _ in range(len(self._recorded))]
                return [head, pack(taken, self._recorded_from_us)]
        if chr(kind) in _CHANGING:
            raise InputError(
                f"not supported: this tree can be watched, not changed (request '{chr(kind)}')"
            )
        raise InputError(f"request not recognized: type {kind}")

    def _blackboards(self, names: str) -> bytes:
        import msgpack  # noqa: PLC0415  # of the extra `live`

        values: dict[str, Any] = self._values
        wanted = [name for name in names.split(";") if name in values]
        packed: bytes = msgpack.packb({name: plain(values[name]) for name in wanted})
        return packed

    def _toggle(self, word: str) -> list[bytes]:
        if word not in {"start", "stop"}:
            raise InputError(f"recording is switched by 'start' or 'stop', got '{word:.40}'")
        self._recording = word == "start"
        if not self._recording:
            return []
        self._recorded.clear()
        self._recorded_from_us = self._now_us
        return [str(self._recorded_from_us).encode()]
