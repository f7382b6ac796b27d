"""Command queue, and the only thread that uses the SDK's drone object."""

from __future__ import annotations

import enum
import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Final

from uav_bt.errors import DroneError

_LOG: Final = logging.getLogger(__name__)

Job = Callable[[], object]


class Kind(enum.Enum):
    """Kind of a command. Kinds that replace waiting ones have at most one entry in the queue."""

    CONNECTION = "connection"
    STICKS = "sticks"
    GIMBAL = "gimbal"
    CAMERA = "camera"  # mode and photographs
    CONTROL = "control"  # change of the piloting source
    LIMITS = "limits"
    MOVE = "move"
    END = "end"  # landing or motor cut


_REPLACES_ITSELF: Final = frozenset({Kind.STICKS, Kind.GIMBAL, Kind.CONTROL, Kind.END})
_DROPPED_BY_END: Final = frozenset({Kind.STICKS, Kind.MOVE, Kind.END})


class CommandQueue:
    """Runs commands on one thread, in order with two exceptions.

    Stick positions, gimbal targets and similar commands replace waiting ones, so that a blocking
    call causes no backlog. A landing or a motor cut goes to the front, and the waiting movements
    are dropped. The SDK's object is made, used and destroyed on this thread only.
    """

    def __init__(self) -> None:
        self._jobs: deque[tuple[Kind, Job]] = deque()
        self._changed = threading.Condition()
        self._closed = False
        self._fault: Exception | None = None
        self.hangs = False  # whether the job of a `run` took longer than its caller waited
        threading.Thread(target=self._run, name="olympe commands", daemon=True).start()

    def submit(self, kind: Kind, job: Job) -> None:
        """Queue a command; raise the error of an earlier one, once.

        The new command is queued in any case, because it may be the landing.
        """
        with self._changed:
            self._put(kind, job)
            fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    def run(self, job: Job, limit_s: float) -> bool:
        """Run a job after the waiting commands; return whether it ended in time.

        A job that takes longer is still finished. Its error is raised in time, or logged later.
        """
        future: Future[None] = Future()

        def work() -> None:
            try:
                job()
            except BaseException as error:  # noqa: BLE001  # raised or logged below
                future.set_exception(_fault(error))
            else:
                future.set_result(None)

        with self._changed:
            self._put(Kind.CONNECTION, work)
        self.hangs = True  # also if the wait is interrupted
        if not wait([future], limit_s).done:
            future.add_done_callback(_report_late)
            return False
        self.hangs = False
        future.result()
        return True

    def close(self, *last: Job) -> None:
        """Accept no more commands; run the queued ones, then the last ones. Returns at once.

        Errors that no later `submit` can raise are logged: one that was not yet raised, and those
        of the remaining commands.
        """
        with self._changed:
            for job in last:
                self._put(Kind.CONNECTION, job)
            self._closed = True
            self._changed.notify()
            fault, self._fault = self._fault, None
        if fault is not None:
            _report(fault)

    def _put(self, kind: Kind, job: Job) -> None:
        if self._closed:
            raise DroneError("the connection to the drone is closed: call connect() first")
        if kind is Kind.END:
            self._drop(_DROPPED_BY_END)
            self._jobs.appendleft((kind, job))
        else:
            self._drop(_REPLACES_ITSELF & {kind})
            self._jobs.append((kind, job))
        self._changed.notify()

    def _drop(self, kinds: frozenset[Kind]) -> None:
        self._jobs = deque(entry for entry in self._jobs if entry[0] not in kinds)

    def _next(self) -> Job | None:
        with self._changed:
            while not self._jobs and not self._closed:
                self._changed.wait()
            return self._jobs.popleft()[1] if self._jobs else None

    def _run(self) -> None:
        while (job := self._next()) is not None:
            try:
                job()
            except BaseException as error:  # noqa: BLE001  # cancellations are not an Exception
                self._failed(_fault(error))

    def _failed(self, fault: Exception) -> None:
        with self._changed:
            kept = self._fault is None and not self._closed
            if kept:
                self._fault = fault  # the next `submit` raises it
        if not kept:
            _report(fault)


def _fault(error: BaseException) -> Exception:
    """Return an error that may be raised on another thread, which a cancellation would end."""
    return error if isinstance(error, Exception) else DroneError(f"the SDK gave up: {error!r}")


def _report(fault: BaseException) -> None:
    _LOG.error("a command to the drone failed: %s: %s", type(fault).__name__, fault)


def _report_late(future: Future[None]) -> None:
    if (fault := future.exception()) is not None:
        _report(fault)
