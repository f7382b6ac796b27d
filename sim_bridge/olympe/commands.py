"""The queue of commands to the SDK, some of whose calls block."""

from __future__ import annotations

import enum
import threading
from collections import deque
from collections.abc import Callable
from typing import Final

Job = Callable[[], object]


class Kind(enum.Enum):
    """What a command is about; the queue holds one at most of each kind that replaces itself."""

    STICKS = "sticks"
    GIMBAL = "gimbal"
    CONTROL = "control"  # who has the sticks
    LIMITS = "limits"
    MOVE = "move"
    END = "end"  # landing, or motors cut


_REPLACES_ITSELF: Final = frozenset({Kind.STICKS, Kind.GIMBAL, Kind.CONTROL, Kind.END})
_OUTLIVES_END: Final = frozenset({Kind.GIMBAL, Kind.CONTROL, Kind.LIMITS})


class CommandQueue:
    """Runs commands on a thread of its own, in order but for two things.

    Stick positions, gimbal targets and the like replace those still waiting, so that a call that
    blocks leaves no backlog. A landing (and a cut of the motors) goes to the front, and what waits
    to move the drone is dropped.
    """

    def __init__(self) -> None:
        self._jobs: deque[tuple[Kind, Job]] = deque()
        self._changed = threading.Condition()
        self._closed = False
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="olympe commands", daemon=True)
        self._thread.start()

    def submit(self, kind: Kind, job: Job) -> None:
        """Queue a command.

        Raises:
            Exception: whatever an earlier command raised, once; this one is queued all the same,
                since it may be the landing.
        """
        with self._changed:
            if kind in _REPLACES_ITSELF:
                self._keep(lambda waiting: waiting is not kind)
            if kind is Kind.END:
                self._keep(lambda waiting: waiting in _OUTLIVES_END)
                self._jobs.appendleft((kind, job))
            else:
                self._jobs.append((kind, job))
            self._changed.notify()
            fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    def close(self, limit_s: float) -> None:
        """Take no more commands; return when those queued are done, or after a time, s."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(limit_s)

    def _keep(self, wanted: Callable[[Kind], bool]) -> None:
        self._jobs = deque(entry for entry in self._jobs if wanted(entry[0]))

    def _next(self) -> Job | None:
        with self._changed:
            while not self._jobs and not self._closed:
                self._changed.wait()
            return self._jobs.popleft()[1] if self._jobs else None

    def _run(self) -> None:
        while (job := self._next()) is not None:
            try:
                job()
            except Exception as error:  # noqa: BLE001  # raised by the next `submit`
                self._fault = error
