"""A thread that encodes and writes, so that a tick does not wait for the disk.

When its queue is full, images are omitted first; a simulated flight waits instead.
A killed flight loses at most `LAG_S` and `FLUSH_S`, less than a second.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Generic, TypeVar

T = TypeVar("T")

LAG_S: Final = 0.5  # largest lag of the file; beyond it images are omitted
QUEUED_IMAGES: Final = 64  # most ticks with images in the queue: 45 MB
QUEUED_TICKS: Final = 256  # most ticks in the queue: 26 s of a flight; frame and maps: 0.3 GB
FLUSH_S: Final = 0.3  # mission time, or idle time, until data goes to the system


class RecordWorker(Generic[T]):
    """Writes items in their order, in a separate thread.

    `write` takes an item and whether with images. With `wait` the flight waits.

    Attributes:
        lost_ticks: ticks without any message.
        failure: reason for an early end of the writing.
    """

    def __init__(
        self, write: Callable[[T, bool], None], flush: Callable[[], None], *, wait: bool
    ) -> None:
        self._write = write
        self._flush = flush
        self._wait = wait
        self._jobs: deque[tuple[T, float, bool]] = deque()  # item, mission time, with images
        self._images_waiting = 0
        self._oldest_s: float | None = None  # mission time of the oldest unwritten tick
        self._changed = threading.Condition()
        self._closing = False
        self.lost_ticks = 0
        self.failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="flight record", daemon=True)
        self._thread.start()

    def put(self, item: T, time_s: float) -> None:
        """Queue an item of a mission time, which must not change any more."""
        with self._changed:
            if self._wait:
                self._changed.wait_for(lambda: self._keeps_up(time_s))
            if len(self._jobs) >= QUEUED_TICKS:
                self.lost_ticks += 1
                return
            images = self._keeps_up(time_s)
            self._images_waiting += images
            self._jobs.append((item, time_s, images))
            if self._oldest_s is None:
                self._oldest_s = time_s
            self._changed.notify_all()

    def _keeps_up(self, time_s: float) -> bool:
        """Return whether there is room for another tick with images."""
        if self._oldest_s is None:
            return True
        return time_s - self._oldest_s <= LAG_S and self._images_waiting < QUEUED_IMAGES

    def close(self) -> None:
        """Wait until all queued items are written."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        flushed_s = None
        while True:
            with self._changed:
                worked = self._changed.wait_for(lambda: self._jobs or self._closing, FLUSH_S)
                job = self._jobs.popleft() if self._jobs else None
                self._oldest_s = None if job is None else job[1]
                if job is None and self._closing:
                    return
            try:
                if self.failure is None and job is not None:
                    item, time_s, images = job
                    self._write(item, images)
                    if flushed_s is None or time_s - flushed_s >= FLUSH_S:
                        flushed_s = time_s
                        self._flush()
                elif self.failure is None and not worked:
                    self._flush()
            except Exception as error:  # noqa: BLE001 - reported at the end
                self.failure = error
            if job is not None:
                with self._changed:
                    self._images_waiting -= job[2]
                    self._oldest_s = self._jobs[0][1] if self._jobs else None
                    self.lost_ticks += self.failure is not None
                    self._changed.notify_all()
