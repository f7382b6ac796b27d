"""Flights in separate processes: a fault that kills a process ends only one flight."""

from __future__ import annotations

import resource
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Final

from benchmarks.fault_flight import Case, died, fly

_MEMORY_BYTES: Final = 4 * 2**30  # of a flight, so that none takes the machine's


def _bound_memory() -> None:
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, hard))


def _process() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_bound_memory)


def fly_each(
    cases: Sequence[Case], folder: Path, workers: int
) -> Iterator[tuple[Case, dict[str, Any]]]:
    """Fly cases and yield each with its line as it ends.

    Args:
        cases: what to fly.
        folder: for reports.
        workers: processes that fly.

    Raises:
        InputError: a case cannot be flown; the others are given up.
    """
    idle: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
    for _ in range(workers):
        idle.put(_process())

    def fly_one(case: Case) -> dict[str, Any]:
        process = idle.get()
        try:
            return process.submit(fly, case, folder).result()
        except BrokenProcessPool:
            process = _process()
            return died(case)
        finally:
            idle.put(process)

    threads = ThreadPoolExecutor(workers)
    try:
        flying = {threads.submit(fly_one, case): case for case in cases}
        for each in as_completed(flying):
            yield flying[each], each.result()
    finally:
        threads.shutdown(cancel_futures=True)
        while not idle.empty():
            idle.get().shutdown()
