"""A thread that encodes and writes, so that a tick does not wait for the disk.

The queue is bounded. When it is full, a real flight goes on and images are omitted first. Omitted
messages are counted by channel. A simulated flight may wait instead, because its clock stands
still. A killed flight loses at most `LAG_S` and `FLUSH_S`, less than a second.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Final, Generic, TypeVar

from uav_bt.record.channels import Channel
from uav_bt.record.record_file import RecordFile

T = TypeVar("T")

LAG_S: Final = 0.5  # largest lag of the file behind the flight; beyond it images are omitted
QUEUED_IMAGES: Final = 64  # most ticks with images in the queue: 640x360, noisy, 45 MB
QUEUED_TICKS: Final = 1_024  # most ticks in the queue; without images some kilobytes each
FLUSH_S: Final = 0.3  # mission time, or idle time, until data goes to the system: several ticks


@dataclass(frozen=True, kw_only=True)
class Encoded:
    """A message ready to be written; an omitted one has no data."""

    channel: Channel
    time_ns: int
    data: bytes | None


@dataclass(frozen=True, kw_only=True)
class _Job(Generic[T]):
    item: T
    time_s: float
    images: bool


class RecordWorker(Generic[T]):
    """Encodes and writes items in their order, in a separate thread.

    Attributes:
        dropped: omitted messages by topic.
        lost_ticks: ticks without any message.
        failure: reason for an early end of the writing.
    """

    def __init__(
        self, sink: RecordFile, encode: Callable[[T, bool], Iterable[Encoded]], *, wait: bool
    ) -> None:
        self._sink = sink
        self._encode = encode
        self._wait = wait
        self._jobs: deque[_Job[T]] = deque()
        self._images_waiting = 0
        self._oldest_s: float | None = None  # mission time of the oldest unwritten tick
        self._changed = threading.Condition()
        self._closing = False
        self._flushed_s: float | None = None
        self.dropped: Counter[str] = Counter()
        self.lost_ticks = 0
        self.failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="flight record", daemon=True)
        self._thread.start()

    def put(self, item: T, time_s: float) -> None:
        """Queue an item of a mission time; it is encoded later and must not change any more."""
        with self._changed:
            if self._wait:
                self._changed.wait_for(lambda: self._keeps_up(time_s))
            if len(self._jobs) >= QUEUED_TICKS:
                self.lost_ticks += 1
                return
            images = self._keeps_up(time_s)
            self._images_waiting += images
            self._jobs.append(_Job(item=item, time_s=time_s, images=images))
            if self._oldest_s is None:
                self._oldest_s = time_s
            self._changed.notify_all()

    def _keeps_up(self, time_s: float) -> bool:
        """Return whether there is room for another tick with images."""
        if self._oldest_s is None:
            return True
        return time_s - self._oldest_s <= LAG_S and self._images_waiting < QUEUED_IMAGES

    def close(self) -> None:
        """Wait until all queued items are written. Safe to call twice."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                worked = self._changed.wait_for(lambda: self._jobs or self._closing, FLUSH_S)
                job = self._jobs.popleft() if self._jobs else None
                self._oldest_s = None if job is None else job.time_s
                if job is None and self._closing:
                    break
            if job is not None:
                self._guarded(partial(self._write, job))
                with self._changed:
                    self._images_waiting -= job.images
                    self._oldest_s = self._jobs[0].time_s if self._jobs else None
                    self.lost_ticks += self.failure is not None
                    self._changed.notify_all()
            elif not worked:
                self._guarded(self._sink.flush)

    def _write(self, job: _Job[T]) -> None:
        for message in self._encode(job.item, job.images):
            if message.data is None:
                self.dropped[message.channel.topic] += 1
            else:
                self._sink.write(message.channel, message.time_ns, message.data)
        if self._flushed_s is None or job.time_s - self._flushed_s >= FLUSH_S:
            self._flushed_s = job.time_s
            self._sink.flush()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do a piece of work, unless an earlier one failed."""
        if self.failure is not None:
            return
        try:
            work()
        except Exception as error:  # noqa: BLE001 - reported at the end: a full disk lands no drone
            self.failure = error
