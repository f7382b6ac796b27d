"""The writing thread: it keeps the order, never blocks a flight, and counts omissions."""

from __future__ import annotations

import threading

import pytest

from uav_bt.record import worker as worker_module
from uav_bt.record.worker import RecordWorker

PATIENCE_S = 30.0


class Disk:
    """A disk that a test can block or fill."""

    def __init__(self, full_after: int | None = None) -> None:
        self.free = threading.Event()
        self.free.set()
        self.busy = threading.Event()
        self.written: list[tuple[int, bool]] = []  # items, and whether with images
        self.flushes = 0
        self.full_after = full_after

    def write(self, item: int, images: bool) -> None:  # noqa: FBT001 - as the worker calls it
        self.busy.set()
        assert self.free.wait(PATIENCE_S)
        if self.full_after is not None and len(self.written) >= self.full_after:
            raise OSError(28, "No space left on device")
        self.written.append((item, images))

    def flush(self) -> None:
        self.flushes += 1


def worker_on(disk: Disk, *, wait: bool) -> RecordWorker[int]:
    return RecordWorker(disk.write, disk.flush, wait=wait)


@pytest.mark.parametrize(
    ("limits", "count", "written", "lost"),
    [
        # 0 and 1 have images; at 2 to 4 two items were waiting; at 5 to 7 the queue was full.
        ((2, 4, 10.0), 8, [(index, index < 2) for index in range(5)], 3),
        ((64, 64, 0.5), 10, [(index, index < 6) for index in range(10)], 0),
    ],
    ids=["a slow disk", "a file that lags"],
)
def test_images_are_omitted_first_and_then_ticks_and_every_loss_is_counted(
    limits: tuple[int, int, float],
    count: int,
    written: list[tuple[int, bool]],
    lost: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, limit in zip(("QUEUED_IMAGES", "QUEUED_TICKS", "LAG_S"), limits, strict=True):
        monkeypatch.setattr(worker_module, name, limit)
    disk = Disk()
    disk.free.clear()
    worker = worker_on(disk, wait=False)
    worker.put(0, 0.0)
    assert disk.busy.wait(PATIENCE_S)  # the thread processes item 0, the queue is empty
    for index in range(1, count):
        worker.put(index, 0.1 * index)
    disk.free.set()
    worker.close()
    assert (disk.written, worker.lost_ticks) == (written, lost)


def test_a_simulated_flight_waits_for_the_disk_and_loses_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(worker_module, "QUEUED_IMAGES", 2)
    disk = Disk()
    disk.free.clear()
    worker = worker_on(disk, wait=True)
    handed_over = threading.Event()

    def fly() -> None:
        for index in range(8):
            worker.put(index, 0.1 * index)
        handed_over.set()

    flight = threading.Thread(target=fly)
    flight.start()
    assert disk.busy.wait(PATIENCE_S)
    assert not handed_over.is_set()
    disk.free.set()
    flight.join(PATIENCE_S)
    worker.close()
    assert disk.written == [(index, True) for index in range(8)]
    assert worker.lost_ticks == 0


def test_a_full_disk_ends_the_writing_and_not_the_flight() -> None:
    disk = Disk(full_after=3)
    worker = worker_on(disk, wait=True)
    for index in range(10):
        worker.put(index, 0.1 * index)
    worker.close()
    assert len(disk.written) == 3
    assert isinstance(worker.failure, OSError)
    assert worker.lost_ticks == 7


def test_the_file_is_flushed_every_half_second_of_the_mission() -> None:
    disk = Disk()
    worker = worker_on(disk, wait=True)
    for index in range(21):
        worker.put(index, index / 10)
    worker.close()
    assert disk.flushes >= 5  # at 0, 0.5, 1.0, 1.5 and 2.0 s, and when idle
