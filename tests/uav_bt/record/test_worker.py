"""The writing thread: it keeps the order, never blocks a flight, and counts omissions."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from uav_bt.record import channels
from uav_bt.record import worker as worker_module
from uav_bt.record.channels import Channel
from uav_bt.record.worker import Encoded, RecordWorker

PATIENCE_S = 30.0


class Disk:
    """A sink that a test can block or fill."""

    def __init__(self, full_after: int | None = None) -> None:
        self.free = threading.Event()
        self.free.set()
        self.busy = threading.Event()
        self.written: list[tuple[str, int]] = []
        self.flushes = 0
        self.full_after = full_after

    def write(self, channel: Channel, time_ns: int, data: bytes) -> None:
        del data
        self.busy.set()
        assert self.free.wait(PATIENCE_S)
        if self.full_after is not None and len(self.written) >= self.full_after:
            raise OSError(28, "No space left on device")
        self.written.append((channel.topic, time_ns))

    def flush(self) -> None:
        self.flushes += 1


def encode(item: int, images: bool) -> Iterator[Encoded]:  # noqa: FBT001 - as the worker calls it
    yield Encoded(channel=channels.TICK, time_ns=item, data=b"{}")
    yield Encoded(channel=channels.CAMERA_IMAGE, time_ns=item, data=b"image" if images else None)


@pytest.fixture(autouse=True)
def _limits(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, limit in (("QUEUED_IMAGES", 2), ("QUEUED_TICKS", 4), ("LAG_S", 10.0)):
        monkeypatch.setattr(worker_module, name, limit)


def test_everything_is_written_in_order_when_the_disk_keeps_up() -> None:
    disk = Disk()
    worker = RecordWorker(disk, encode, wait=True)
    for index in range(50):
        worker.put(index, 0.1 * index)
    worker.close()
    worker.close()  # twice is fine
    assert disk.written == [
        (topic, index) for index in range(50) for topic in ("/mission/tick", "/camera/image")
    ]
    assert (worker.dropped, worker.lost_ticks, worker.failure) == ({}, 0, None)


def test_a_slow_disk_costs_images_first_and_then_ticks_and_every_loss_is_counted() -> None:
    disk = Disk()
    disk.free.clear()
    worker = RecordWorker(disk, encode, wait=False)
    worker.put(0, 0.0)
    assert disk.busy.wait(PATIENCE_S)  # the thread processes item 0, the queue is empty
    for index in range(1, 8):
        worker.put(index, 0.1 * index)
    disk.free.set()
    worker.close()
    # 0 and 1 have images; at 2 to 4 two items were waiting; at 5 to 7 the queue was full.
    both = [(topic, index) for index in (0, 1) for topic in ("/mission/tick", "/camera/image")]
    assert disk.written == [*both, *(("/mission/tick", index) for index in (2, 3, 4))]
    assert worker.dropped == {"/camera/image": 3}
    assert worker.lost_ticks == 3


def test_a_file_that_lags_gets_no_images_until_it_has_caught_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, limit in (("QUEUED_IMAGES", 64), ("QUEUED_TICKS", 64), ("LAG_S", 0.5)):
        monkeypatch.setattr(worker_module, name, limit)
    disk = Disk()
    disk.free.clear()
    worker = RecordWorker(disk, encode, wait=False)
    worker.put(0, 0.0)
    assert disk.busy.wait(PATIENCE_S)
    for index in range(1, 10):
        worker.put(index, index / 10)
    disk.free.set()
    worker.close()
    images = [index for topic, index in disk.written if topic == "/camera/image"]
    assert images == [0, 1, 2, 3, 4, 5]
    assert [index for topic, index in disk.written if topic == "/mission/tick"] == list(range(10))
    assert worker.dropped == {"/camera/image": 4}


def test_a_simulated_flight_waits_for_the_disk_and_loses_nothing() -> None:
    disk = Disk()
    disk.free.clear()
    worker = RecordWorker(disk, encode, wait=True)
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
    assert len(disk.written) == 16
    assert (worker.dropped, worker.lost_ticks) == ({}, 0)


def test_a_full_disk_ends_the_writing_and_not_the_flight() -> None:
    disk = Disk(full_after=3)
    worker = RecordWorker(disk, encode, wait=True)
    for index in range(10):
        worker.put(index, 0.1 * index)
    worker.close()
    assert len(disk.written) == 3
    assert isinstance(worker.failure, OSError)
    assert worker.lost_ticks == 9  # the second tick's image and all later messages did not fit


def test_the_file_is_flushed_every_half_second_of_the_mission() -> None:
    disk = Disk()
    worker = RecordWorker(disk, encode, wait=True)
    for index in range(21):
        worker.put(index, index / 10)
    worker.close()
    assert disk.flushes >= 5  # at 0, 0.5, 1.0, 1.5 and 2.0 s, and when idle
