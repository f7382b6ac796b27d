"""TCP port of the drone; its oldest connections are closed for new ones."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from typing import Final

from sim_bridge.loopback.codec import WireError
from sim_bridge.loopback.handshake import port_error
from sim_bridge.loopback.web import MAX_HEAD_BYTES

_LOG = logging.getLogger(__name__)

_MAX_CONNECTIONS: Final = 64  # open connections on a port; one more closes the oldest

Service = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class Listener:
    """Listens on a port from `open` to `close`.

    Args:
        service: serves one connection to its end.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._server: asyncio.Server | None = None
        self._open: dict[asyncio.Task[None], str] = {}  # hosts of the clients, oldest first
        self._kept: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """The bound port."""
        return 0 if self._server is None else int(self._server.sockets[0].getsockname()[1])

    async def open(self, address: str, port: int, what: str) -> None:
        """Bind the port.

        Args:
            address: the numeric address.
            port: the port; 0 selects a free one.
            what: purpose of the port, for messages.

        Raises:
            PortTakenError: the port is taken, or may not be used.
        """
        try:
            self._server = await asyncio.start_server(
                self._accept, address, port, limit=MAX_HEAD_BYTES
            )
        except OSError as error:
            raise port_error(error, address, port, what) from error

    async def close(self) -> None:
        """End all connections and free the port; safe to call twice."""
        if self._server is not None:
            self._server.close()
        tasks = list(self._open)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def keep_newest(self, host: str) -> None:
        """Keep the newest connection of a host open, even with too many others."""
        self._kept = next((task for task in reversed(self._open) if self._open[task] == host), None)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._open) >= _MAX_CONNECTIONS:
            oldest = next(task for task in self._open if task is not self._kept)
            del self._open[oldest]
            oldest.cancel()
        task = asyncio.create_task(self._converse(reader, writer))
        peer = writer.get_extra_info("peername")
        self._open[task] = "" if peer is None else str(peer[0])
        task.add_done_callback(lambda done: self._open.pop(done, None))

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection; its errors do not end the server."""
        try:
            await self._service(reader, writer)
        except (OSError, WireError) as error:
            _LOG.info("a connection ended: %s", error)
        finally:
            writer.close()
            with contextlib.suppress(OSError):  # it is gone either way
                await writer.wait_closed()
