"""Server for Groot2 on a separate thread; it can be reached from this machine only.

Source: BehaviorTree.CPP's `groot2_publisher.cpp`. There, requests are answered by a ZeroMQ REP
socket, and notifications are sent by a PUB socket on the next port. The only notification reports a
breakpoint. Breakpoints are not supported here, so that socket is silent; it exists because Groot2
connects to it. This server uses a ROUTER socket for requests, because a REP socket stops answering
all clients after bytes that are not ZeroMQ. Clients notice no difference.
"""

from __future__ import annotations

import logging
import threading
from typing import TYPE_CHECKING, Final, Self

from uav_bt.errors import InputError
from uav_bt.groot.groot_view import GrootView
from uav_bt.plugins import need

if TYPE_CHECKING:
    import zmq

_LOG: Final = logging.getLogger(__name__)

DEFAULT_PORT: Final = 1667  # of Groot2
_HOST: Final = "127.0.0.1"
_MAX_FRAME_BYTES: Final = 65_536  # size limit of a request; a longer one ends the connection
# Queue of requests and answers per client; Groot2 has one at a time. Further ones are dropped.
_MAX_WAITING: Final = 8
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
