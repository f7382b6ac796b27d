"""Server for Groot2 on a separate thread; by default reachable from this machine only.

Source: BehaviorTree.CPP's `groot2_publisher.cpp`. There, requests are answered by a ZeroMQ REP
socket, and notifications are sent by a PUB socket on the next port. The only notification reports a
breakpoint. Breakpoints are not supported here, so that socket is silent; it exists because Groot2
connects to it. This server uses a ROUTER socket for requests, because a REP socket can stop
answering all clients after bytes that are not ZeroMQ. Clients notice no difference.
"""

from __future__ import annotations

import ipaddress
import logging
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Self

from uav_bt.errors import InputError, MissionError, ValueRangeError
from uav_bt.groot.groot_protocol import DEFAULT_PORT, ProtocolError, error_reply, parse_request
from uav_bt.groot.groot_view import GrootView
from uav_bt.plugins import need

if TYPE_CHECKING:
    import zmq

_LOG: Final = logging.getLogger(__name__)

_MAX_PORT: Final = 65_534  # the next port must exist, too
_MAX_FRAME_BYTES: Final = 65_536  # size limit of a request; a longer one ends the connection
# Queue of requests and answers per client; Groot2 has one at a time. Further ones are dropped.
_MAX_WAITING: Final = 8
_FREE_PAIR_TRIES: Final = 20  # tries to find two neighbouring free ports
_STOP: Final = "inproc://stop"


@dataclass(frozen=True, kw_only=True)
class GrootConfig:
    """Address of the publisher."""

    port: int = DEFAULT_PORT  # port of requests, followed by that of notifications; 0: free ones
    host: str = "127.0.0.1"  # address of the interface to listen on
    # All clients of the port can read tree, board and positions. There are no passwords.
    allow_remote: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.port <= _MAX_PORT:
            raise ValueRangeError(f"a port must lie within 0 and {_MAX_PORT}, got {self.port}")
        try:
            address = ipaddress.ip_address(self.host)
        except ValueError:
            raise InputError(
                f"expected the address of an interface such as 127.0.0.1, got '{self.host}'"
            ) from None
        if not address.is_loopback and not self.allow_remote:
            raise InputError(
                f"{self.host} can be reached from other machines, which then read all that the "
                "mission knows; say allow_remote=True if that is meant, or use an SSH tunnel"
            )


class GrootPublisher:
    """Answers requests of Groot2 about one tree. Use it as a context manager, or open and close it.

    It listens from `open` on, so that a taken port is reported before a flight. `show` sets the
    tree later.

    Args:
        config: address and port.
    """

    def __init__(self, config: GrootConfig | None = None) -> None:
        self._config = config or GrootConfig()
        self._zmq = _zmq()
        self._view: GrootView | None = None
        self._port: int | None = None
        self._context: zmq.Context[Any] | None = None
        self._stop: zmq.Socket[bytes] | None = None
        self._thread: threading.Thread | None = None

    @property
    def port(self) -> int:
        """The port of requests; the next port is for notifications.

        Raises:
            MissionError: the publisher is not open.
        """
        if self._port is None:
            raise MissionError("the Groot2 publisher is not open: call open() first")
        return self._port

    def open(self) -> None:
        """Bind the ports and start to answer.

        Raises:
            InputError: a port is taken, or the interface does not exist.
        """
        if self._thread is not None:
            raise MissionError("the Groot2 publisher is open already")
        zmq_ = self._zmq
        context = zmq_.Context()
        try:
            replies, notifications = self._bind(context)
            stop, stopped = context.socket(zmq_.PAIR), context.socket(zmq_.PAIR)
            stopped.bind(_STOP)
            stop.connect(_STOP)
        except BaseException:
            context.destroy(linger=0)
            raise
        self._context, self._stop = context, stop
        self._thread = threading.Thread(
            target=self._serve,
            args=(replies, notifications, stopped),
            name="groot2-publisher",
            daemon=True,  # an unclosed publisher must not keep the process alive
        )
        self._thread.start()

    def show(self, view: GrootView) -> None:
        """Set the tree to show; may be called from any thread."""
        self._view = view

    def close(self) -> None:
        """Stop answering and free the ports; safe to call twice."""
        if self._thread is None or self._stop is None or self._context is None:
            return
        self._stop.send(b"")
        self._thread.join()
        self._stop.close(linger=0)
        self._context.term()
        self._thread = self._stop = self._context = self._port = None

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()

    # --- sockets ----------------------------------------------------------------------------------

    def _bind(self, context: zmq.Context[Any]) -> tuple[zmq.Socket[bytes], zmq.Socket[bytes]]:
        wanted = self._config.port
        for _ in range(1 if wanted else _FREE_PAIR_TRIES):
            replies = self._socket(context, self._zmq.ROUTER)
            port = self._bind_one(replies, wanted)
            notifications = self._socket(context, self._zmq.PUB)
            try:
                self._bind_one(notifications, port + 1)
            except InputError:
                if wanted:
                    raise
                replies.close()
                notifications.close()
                continue
            self._port = port
            return replies, notifications
        raise InputError(f"found no two free neighbouring ports on {self._config.host}")

    def _socket(self, context: zmq.Context[Any], kind: int) -> zmq.Socket[bytes]:
        socket: zmq.Socket[bytes] = context.socket(kind)
        socket.setsockopt(self._zmq.LINGER, 0)
        socket.setsockopt(self._zmq.MAXMSGSIZE, _MAX_FRAME_BYTES)
        socket.setsockopt(self._zmq.SNDHWM, _MAX_WAITING)
        socket.setsockopt(self._zmq.RCVHWM, _MAX_WAITING)
        if ":" in self._config.host:
            socket.setsockopt(self._zmq.IPV6, 1)
        return socket

    def _bind_one(self, socket: zmq.Socket[bytes], port: int) -> int:
        """Bind and return the port; 0 selects a free one."""
        host = f"[{self._config.host}]" if ":" in self._config.host else self._config.host
        try:
            socket.bind(f"tcp://{host}:{port or '*'}")
        except self._zmq.ZMQError as error:
            raise InputError(
                f"Groot2 cannot be served on {host}, port {port}: {error.strerror}; Groot2 needs "
                f"ports {self._config.port} and {self._config.port + 1}, choose others or stop "
                "whatever uses them"
            ) from error
        endpoint = socket.getsockopt(self._zmq.LAST_ENDPOINT)
        return int(bytes(endpoint).rstrip(b"\0").rsplit(b":", 1)[1])

    # --- the thread -------------------------------------------------------------------------------

    def _serve(
        self,
        replies: zmq.Socket[bytes],
        notifications: zmq.Socket[bytes],
        stopped: zmq.Socket[bytes],
    ) -> None:
        poller = self._zmq.Poller()
        poller.register(replies, self._zmq.POLLIN)
        poller.register(stopped, self._zmq.POLLIN)
        try:
            while True:
                ready = dict(poller.poll())
                if stopped in ready:
                    return
                try:
                    client, *frames = replies.recv_multipart(self._zmq.NOBLOCK)
                except self._zmq.Again:  # a connection that was lost in between looks ready, too
                    continue
                if not frames or frames[0]:
                    continue  # not from a REQ socket, which sends an empty frame first
                replies.send_multipart([client, b"", *self._answer(frames[1:])])
        except self._zmq.ZMQError:
            _LOG.exception("the Groot2 publisher has stopped; the mission continues")
        finally:
            for socket in (replies, notifications, stopped):
                socket.close(linger=0)

    def _answer(self, frames: list[bytes]) -> list[bytes]:
        view = self._view
        try:
            request = parse_request(frames)
            if view is None:
                return error_reply("no tree yet: the mission has not begun")
            body = view.answer(request)
        except ProtocolError as error:
            return error_reply(str(error))
        except Exception as error:  # noqa: BLE001  # converting a value may raise any error
            _LOG.warning("a Groot2 request could not be answered", exc_info=True)
            return error_reply(f"{type(error).__name__}: {error}")
        return [request.reply_header(view.tree_id), *([] if body is None else [body])]


def _zmq() -> Any:
    """Import ZeroMQ, which the extra installs, only where it is used."""
    need("live", "zmq", "msgpack", what="Groot2")
    import zmq  # noqa: PLC0415  (an extra)

    return zmq
