"""Flights on a Dask cluster: each thread of its workers keeps a process that flies."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import threading
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from distributed import CancelledError, Client, as_completed
from distributed.comm.core import connect

import uav_bt
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.runner import Flown
from uav_bt.campaign.workers import Fly, Line, WorkerPool, lost_line
from uav_bt.errors import InputError, UavBtError

_pools: dict[tuple[Fly, int], WorkerPool] = {}  # of this Dask worker, by function and thread


def _fly(fly: Fly, task: FlightTask, timeout_s: float) -> Line:
    """Fly a task on a Dask worker, in another process, as on this machine."""
    multiprocessing.current_process().daemon = False  # a daemon may start no processes
    key = fly, threading.get_ident()
    if key not in _pools:
        _pools[key] = WorkerPool(fly, workers=1)
    return _pools[key].line_of(_pools[key].start(task, timeout_s))


def _close_pools(fly: Fly) -> None:
    """Stop the flights of a Dask worker."""
    for key in [key for key in tuple(_pools) if key[0] == fly]:
        _pools.pop(key).close()


@dataclass(frozen=True)
class DaskBackend:
    """The workers of a Dask cluster; a flight at a time in each of their threads."""

    address: str  # HOST:PORT of the scheduler
    connect_s: float = 10.0  # how long to wait for the scheduler, and for the first worker

    def __str__(self) -> str:
        return "dask"

    def run(self, fly: Fly, tasks: Iterable[FlightTask], timeout_s: float) -> Flown:
        """Fly tasks; see `Backend`."""
        for name in tuple(logging.root.manager.loggerDict):
            if name.startswith("distributed"):  # its tracebacks: our errors have the cause
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        with self._connected() as client:
            flights = {  # `pure=False`: no result of another campaign is taken
                client.submit(_fly, fly, task, timeout_s, pure=False): task for task in tasks
            }
            try:
                for future in as_completed(flights, loop=client.loop):  # type: ignore[no-untyped-call]
                    task, error = flights.pop(future), future.exception()
                    if isinstance(error, CancelledError | InputError):
                        raise error
                    lost = f"lost by the cluster: {type(error).__name__}: {error}"
                    yield task, lost_line(task, lost) if error else future.result()
            except (OSError, CancelledError) as error:
                raise UavBtError(
                    "the connection to the Dask cluster was lost; the same command goes on"
                ) from error
            finally:
                if client.status == "running":  # workers that are gone have nothing to close
                    client.run(_close_pools, fly, on_error="ignore")

    def _connected(self) -> Client:
        """Return a client of the scheduler, which has workers of this version."""
        address, wait_s = self.address, self.connect_s
        try:
            # A `Client` waits for ever for a scheduler that does not answer.
            greeting = connect(address, timeout=wait_s)  # type: ignore[no-untyped-call]
            asyncio.run(asyncio.wait_for(greeting, wait_s)).abort()
            client = Client(address, timeout=wait_s, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise InputError(
                f"no Dask scheduler answers at {address} within {wait_s:g} s; start one with "
                "`dask scheduler`, and workers with `dask worker ADDRESS`"
            ) from error
        with suppress(TimeoutError):
            client.wait_for_workers(1, timeout=wait_s)
        versions: Any = client.get_versions(packages=["uav_bt"])
        found = {one["packages"]["uav_bt"] for one in versions["workers"].values()}
        if found == {uav_bt.__version__}:
            return client
        client.close()  # type: ignore[no-untyped-call]
        there = f"there are {found or 'none'}; start some with `dask worker {address}`"
        raise InputError(f"the cluster's workers need uav-bt {uav_bt.__version__}, and {there}")
