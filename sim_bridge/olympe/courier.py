"""Commands on a thread of their own: some of the SDK's calls wait, and a mission must not."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

__all__ = ["Courier"]

Job = Callable[[], object]


class Courier:
    """Runs jobs one after the other, in the order they were given."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._fault: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="olympe commands", daemon=True)
        self._thread.start()

    def give(self, job: Job) -> None:
        """Have a job done soon.

        Raises:
            Exception: whatever an earlier job raised, once; this job is done all the same, since
                it may be the landing.
        """
        self._jobs.put(job)
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    def close(self, limit_s: float) -> None:
        """Take no more jobs; return when those given are done, or after a time."""
        self._jobs.put(None)
        self._thread.join(limit_s)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except Exception as error:  # noqa: BLE001  # raised where the next job is given
                self._fault = error
