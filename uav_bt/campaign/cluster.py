"""Flights on a Dask cluster: each thread of its workers keeps a process that flies."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from distributed import CancelledError, Client, as_completed
from distributed.comm.core import connect

import uav_bt
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.runner import Answers
from uav_bt.campaign.workers import FAILED, WorkerPool
from uav_bt.errors import InputError, UavBtError

_CONNECT_S: Final = 10.0  # to reach a scheduler, and for a worker to come up

_lock = threading.Lock()
_pools: dict[tuple[str, int], WorkerPool] = {}  # of this Dask worker, by function and thread


def _fly(function: str, task: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
    """Fly a task on a Dask worker, in another process, as on this machine."""
    # Dask's nanny starts its workers as daemons, which may start no processes.
    multiprocessing.current_process().daemon = False
    with _lock:
        key = function, threading.get_ident()
        if key not in _pools:
            _pools[key] = WorkerPool(function, workers=1)
        pool = _pools[key]
    return pool.fly(task, timeout_s).result()


def _close_pools(function: str) -> None:
    """Stop the flights of a Dask worker."""
    with _lock:
        closed = [_pools.pop(key) for key in tuple(_pools) if key[0] == function]
    for pool in closed:
        pool.close()


def _version() -> str:
    return uav_bt.__version__


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask from writing tracebacks: our errors have the cause."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


async def _greet(address: str, connect_s: float) -> None:
    """Shake hands with a scheduler; a `Client` waits for ever for one that does not answer."""
    comm = await connect(address, timeout=connect_s)  # type: ignore[no-untyped-call]
    await comm.close()


class DaskBackend:
    """The workers of a Dask cluster; as many flights at a time as they have threads.

    Workers need uav-bt, and find trees and scenes that do not ship with it under the same paths.

    Args:
        address: HOST:PORT of the scheduler.
        connect_s: how long to wait for it, and for its first worker.
    """

    def __init__(self, address: str, *, connect_s: float = _CONNECT_S) -> None:
        self._address = address
        self._connect_s = connect_s

    def __str__(self) -> str:
        return "dask"

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks; see `Backend`.

        Raises:
            InputError: the scheduler does not answer, has no workers, or they have another uav-bt.
            UavBtError: the connection was lost.
        """
        with _quiet(), self._connected() as client:
            self._check_workers(client)
            try:
                yield from self._gather(client, function, tasks, timeout_s)
            except (OSError, CancelledError) as error:
                raise UavBtError(
                    "the connection to the Dask cluster was lost; the flights that ended are kept, "
                    "and the same command goes on from there"
                ) from error
            finally:
                if client.status == "running":
                    # Workers that are gone have nothing to close.
                    client.run(_close_pools, function, on_error="ignore")

    def _connected(self) -> Client:
        try:
            asyncio.run(asyncio.wait_for(_greet(self._address, self._connect_s), self._connect_s))
            return Client(  # type: ignore[no-untyped-call]
                self._address, timeout=self._connect_s, set_as_default=False
            )
        except (OSError, ValueError) as error:
            raise InputError(
                f"no Dask scheduler answers at {self._address} within {self._connect_s:g} s; "
                "start one with `dask scheduler`, and workers with `dask worker ADDRESS`"
            ) from error

    def _check_workers(self, client: Client) -> None:
        try:
            client.wait_for_workers(1, timeout=self._connect_s)
        except TimeoutError as error:
            raise InputError(
                f"the Dask cluster at {self._address} has no workers; "
                f"start some with `dask worker {self._address}`"
            ) from error
        try:
            found = client.run(_version)
        except ImportError as error:
            raise InputError(
                f"the workers of {self._address} cannot import uav-bt: {error}; install it there"
            ) from error
        others = {name: version for name, version in found.items() if version != uav_bt.__version__}
        if others:
            raise InputError(
                f"all workers need uav-bt {uav_bt.__version__}, as here; there are {others}"
            )

    @staticmethod
    def _gather(
        client: Client, function: str, tasks: Iterable[FlightTask], timeout_s: float
    ) -> Answers:
        # A flight is the same wherever it is flown, but no result of another campaign is taken.
        flights = {
            client.submit(_fly, function, task.to_json(), timeout_s, pure=False): task
            for task in tasks
        }
        for future in as_completed(flights, loop=client.loop):  # type: ignore[no-untyped-call]
            task = flights.pop(future)
            error = future.exception()
            if error is None:
                answer = future.result()
            elif isinstance(error, CancelledError):
                raise error
            else:
                answer = {FAILED: f"lost by the cluster: {type(error).__name__}: {error}"}
            yield task, answer
