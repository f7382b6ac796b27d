"""Monitoring of a flight's tree: sends its transitions to a log, to Groot2, or both.

with watched_live(btlog="flight.btlog", groot=1667) as watch:
    app.fly("land_only", listeners=[lambda flight: watch(flight.mission, flight.context)])

The ticking thread replaces whole values and appends to a bounded queue, without locks or waits. A
request during a tick gets the state at the end of the tick before.

Sources: BehaviorTree.CPP's `groot2_protocol.h` and `groot2_publisher.cpp`. The first frame of a
request is protocol (u8), type (u8) and id (u32), little endian. The first frame of its answer is
the same six bytes and the 16-byte id of the tree. The second frame holds the content.

There, requests are answered by a ZeroMQ REP socket, and notifications are sent by a PUB socket on
the next port. The only notification reports a breakpoint. Breakpoints are not supported here, so
that socket is silent; it exists because Groot2 connects to it. This server uses a ROUTER socket for
requests, because a REP socket stops answering all clients after bytes that are not ZeroMQ. Clients
notice no difference.
"""

from __future__ import annotations

import logging
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self
from uuid import uuid4

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.board.plain_values import plain
from uav_bt.errors import InputError
from uav_bt.groot.transitions import (
    BtlogWriter,
    Transition,
    TransitionRecorder,
    TreeNumbering,
    pack,
    tree_xml,
)
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.plugins import need
from uav_bt.tree import MissionTree
from uav_bt.tree.status import Status

if TYPE_CHECKING:
    import zmq

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
            raise InputError(f"this tree can be watched, not changed (request '{chr(kind)}')")
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
        self._recording = False  # while the other thread may append
        if word == "stop":
            return []
        self._recorded.clear()
        self._recorded_from_us = self._now_us
        self._recording = True
        return [str(self._recorded_from_us).encode()]


_LOG: Final = logging.getLogger(__name__)

DEFAULT_PORT: Final = 1667  # of Groot2
_HOST: Final = "127.0.0.1"
_MAX_FRAME_BYTES: Final = 65_536  # size limit of a request; a longer one ends the connection
# Queue of requests and answers per client; further ones are dropped. Groot2 has one at a time, but
# ZeroMQ may count sent answers as waiting for 1 ms more: a queue of 8 lost some on a busy machine.
_MAX_WAITING: Final = 100
_WAIT_MS: Final = 100  # for a request, before the thread looks whether it shall stop


class GrootPublisher:
    """Answers requests of Groot2 about one tree in its context.

    It listens from the beginning of the context on, so that a taken port is reported before a
    flight; the port after that of requests is for notifications. `show` sets the tree later.
    """

    def __init__(self, port: int = DEFAULT_PORT) -> None:
        need("live", "Groot2")
        import zmq  # noqa: PLC0415  (an extra)

        self._zmq = zmq
        self._port = port
        self._view: GrootView | None = None
        self._stop = threading.Event()

    def show(self, view: GrootView) -> None:
        """Set the tree to show; may be called from any thread."""
        self._view = view

    def __enter__(self) -> Self:
        """Bind the ports and start to answer."""
        self._context: zmq.Context[zmq.Socket[bytes]] = self._zmq.Context()
        try:
            self._replies = self._bound(self._zmq.ROUTER, self._port)
            self._silent = self._bound(self._zmq.PUB, self._port + 1)
        except BaseException:
            self._context.destroy(linger=0)
            raise
        # An unclosed publisher must not keep the process alive.
        self._thread = threading.Thread(target=self._serve, name="groot2-publisher", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop answering and free the ports."""
        self._stop.set()
        self._thread.join()
        self._context.destroy(linger=0)

    def _bound(self, kind: int, port: int) -> zmq.Socket[bytes]:
        socket = self._context.socket(kind)
        socket.setsockopt(self._zmq.MAXMSGSIZE, _MAX_FRAME_BYTES)
        socket.setsockopt(self._zmq.SNDHWM, _MAX_WAITING)
        socket.setsockopt(self._zmq.RCVHWM, _MAX_WAITING)
        socket.setsockopt(self._zmq.RCVTIMEO, _WAIT_MS)
        try:
            socket.bind(f"tcp://{_HOST}:{port}")
        except self._zmq.ZMQError as error:
            raise InputError(
                f"Groot2 cannot be served on {_HOST}, port {port}: {error.strerror}; Groot2 needs "
                f"ports {self._port} and {self._port + 1}, choose others or stop whatever uses them"
            ) from error
        return socket

    # --- the thread -------------------------------------------------------------------------------

    def _serve(self) -> None:
        try:
            while not self._stop.is_set():
                try:
                    client, *frames = self._replies.recv_multipart()
                except self._zmq.Again:
                    continue
                if frames and not frames[0]:  # a REQ socket sends an empty frame first
                    self._replies.send_multipart([client, b"", *self._answer(frames[1:])])
        except self._zmq.ZMQError:
            _LOG.exception("the Groot2 publisher has stopped; the mission continues")

    def _answer(self, frames: list[bytes]) -> list[bytes]:
        if self._view is None:
            return [b"error", b"no tree yet: the mission has not begun"]
        try:
            return self._view.answer(frames)
        except InputError as error:
            reason = str(error)
        except Exception as error:  # noqa: BLE001  # converting a value may raise any error
            _LOG.warning("a Groot2 request could not be answered", exc_info=True)
            reason = f"{type(error).__name__}: {error}"
        return [b"error", reason.encode(errors="replace")]


class TreeWatch:
    """Watches one tree, set up but not ticked yet, until `finish`; its log begins here."""

    def __init__(
        self,
        tree: MissionTree,
        context: MissionContext,
        *,
        log: BtlogWriter | None = None,
        publisher: GrootPublisher | None = None,
    ) -> None:
        numbering = TreeNumbering(tree)
        self._clock = context.clock
        self._log = log
        self._view: GrootView | None = None
        self._last_us = self._time_us()
        if log is not None:
            log.begin(tree_xml(numbering), self._last_us)
        if publisher is not None:
            self._view = GrootView(numbering, context.board, self._last_us)
            publisher.show(self._view)
        self._recorder = TransitionRecorder(numbering, context.clock)

    def on_tick(self, _record: TickRecord | None = None) -> None:
        """Send the transitions since the last call; never waits for a client."""
        self._hand_on(self._time_us())

    def finish(self) -> None:
        """Stop watching the tree, and send the transitions of its halt. Safe to call twice."""
        self._recorder.detach()
        self._hand_on(self._last_us)  # the drone with its clock may be disconnected

    def _hand_on(self, now_us: int) -> None:
        transitions = self._recorder.take()
        self._last_us = max([now_us, *(each.time_us for each in transitions[-1:])])
        if self._log is not None:
            self._log.write(transitions)
        if self._view is not None:
            self._view.update(transitions, self._last_us)

    def _time_us(self) -> int:
        return round(self._clock.now() * 1e6)


@contextmanager
def watched_live(
    *, btlog: str | Path | None = None, groot: int | None = None
) -> Iterator[Callable[[MissionTree, MissionContext], Sequence[TickListener]]]:
    """Watch the trees of flights in the context, by the listeners of what it yields.

    Args:
        btlog: the log to write, `*.btlog`.
        groot: port for Groot2 on this machine; the next one is used as well.

    Raises:
        FileError: the log cannot be written (before the flight), or is incomplete (after it).
        InputError: Groot2's ports are taken.
        MissingDependencyError: Groot2 needs the extra `live`.
    """
    with ExitStack() as stack:
        publisher = None if groot is None else stack.enter_context(GrootPublisher(groot))
        log = None if btlog is None else stack.enter_context(BtlogWriter(Path(btlog)))

        def follow(tree: MissionTree, context: MissionContext) -> Sequence[TickListener]:
            if log is None and publisher is None:
                return ()
            watch = TreeWatch(tree, context, log=log, publisher=publisher)
            stack.callback(watch.finish)
            return (watch,)

        yield follow
