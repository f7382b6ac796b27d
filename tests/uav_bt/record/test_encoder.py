"""Encoding of the board's and the referee's values, and the thread that writes them."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.record.test_values import site_map
from tests.worlds.leaves import map_with
from tests.worlds.values import corridor, fix, tick, truth
from uav_bt import types
from uav_bt.record import Quality, messages
from uav_bt.record import worker as worker_module
from uav_bt.record.channels import CommandNote
from uav_bt.record.encoder import MomentEncoder, RawMoment
from uav_bt.record.moment import Moment, moment_of
from uav_bt.record.record_file import Timeline
from uav_bt.record.worker import RecordWorker
from uav_bt.testing import pinhole
from uav_bt.tree.status import IDLE, RUNNING
from uav_bt.types.ground import Footprint, Ground, Standing

CAPTURED_S = 1.1000000000000003
DEPTH = np.array([[0.5, np.nan, np.inf], [1.2345, 80.0, 0.0]], dtype=np.float32)
MOVER = types.MoverState(
    name="mover-1",
    pose=types.Pose(x_m=0.5, y_m=-1.0, z_m=0.85, yaw_rad=0.0),
    vx_mps=0.5,
    vy_mps=0.0,
)
ABOVE = types.Pose(x_m=1.0, y_m=0.0, z_m=1.5, yaw_rad=math.pi / 2)
TRUTH = truth(ABOVE, 1.2, contacts=("mark",), clearance_m=math.inf, movers=(MOVER,))
BOARD: dict[str, Any] = {
    "class_map": paper_map(ids=np.arange(6, dtype=np.uint8).reshape(2, 3), captured_s=CAPTURED_S),
    "relative_depth": types.DepthMap(depth=DEPTH, metric=False, captured_s=CAPTURED_S),
    "metric_depth": types.DepthMap(
        depth=DEPTH, metric=True, captured_s=CAPTURED_S, confidence=0.25
    ),
    "corridor": corridor(math.inf, "left", nearest_m=0.7, captured_s=CAPTURED_S),
    "mark": fix(CAPTURED_S, 0.1, 0.2),
    "site_map": map_with(types.NearObstacles(captured_s=CAPTURED_S)),
    "phase": "explore",
}


def raw_moment(board: dict[str, Any] | None = None) -> RawMoment:
    state = types.DroneState(captured_s=1.2, flying=types.FlyingState.HOVERING)
    values = BOARD if board is None else board
    return RawMoment(
        tick=tick(state, active=("Main",), truth=TRUTH),
        commands=CommandNote(decided=types.HOVER, sent=types.HOVER),
        board={name: (value, CAPTURED_S) for name, value in values.items()},
        statuses=(RUNNING, IDLE),
    )


def encoder(quality: Quality = "lossless") -> MomentEncoder:
    return MomentEncoder(Timeline(start_ns=10**18, start_s=0.0), pinhole(), quality)


def read(made: MomentEncoder, moment: RawMoment) -> Moment:
    found = {channel.topic: data for channel, data in made.encode(moment, images=True) if data}
    return moment_of(found, ("FAILURE",), CLASSES)


def test_what_the_board_knew_comes_back() -> None:
    moment = read(encoder(), raw_moment())
    assert moment.class_map is not None
    assert np.array_equal(moment.class_map.ids, BOARD["class_map"].ids)
    assert moment.class_map.captured_s == CAPTURED_S
    assert moment.relative_depth is not None
    assert np.array_equal(moment.relative_depth.depth, DEPTH, equal_nan=True)
    assert moment.metric_depth is not None
    assert moment.metric_depth.depth == pytest.approx(
        np.array([[0.5, np.nan, np.nan], [1.234, 65.535, np.nan]]), abs=1e-3, nan_ok=True
    )
    assert (moment.metric_depth.metric, moment.metric_depth.confidence) == (True, 0.25)
    assert moment.corridor == BOARD["corridor"]
    assert moment.mark == BOARD["mark"]
    assert moment.near is not None
    assert moment.near.points_m.shape == (0, 2)
    assert moment.truth == TRUTH
    assert moment.statuses == ("RUNNING", "IDLE")
    assert moment.board["phase"] == {"value": "explore", "captured_s": CAPTURED_S}


def test_unchanged_values_and_relative_depth_of_small_records_are_not_written() -> None:
    made = encoder()
    read(made, raw_moment())
    again = read(made, raw_moment())
    assert again.class_map is None
    assert again.corridor is None
    assert again.statuses == ("FAILURE",)  # the statuses of the last tick are kept
    high = read(encoder("high"), raw_moment())
    assert (high.relative_depth, high.metric_depth is None) == (None, False)
    small = read(encoder("small"), raw_moment())
    assert small.class_map is small.metric_depth is small.relative_depth is None
    newer = replace(BOARD["corridor"], nearest_m=0.6)
    assert read(made, raw_moment({**BOARD, "corridor": newer})).corridor == newer


def test_the_body_turns_with_the_drone_and_the_lens_with_the_gimbal() -> None:
    west = types.Pose(x_m=0.0, y_m=0.0, z_m=1.0, yaw_rad=math.pi / 2)
    for attitude, axis, seen in (
        (types.Attitude(), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        (types.Attitude(pitch_rad=0.2), (1.0, 0.0, 0.0), (0.0, math.cos(0.2), math.sin(0.2))),
        (types.Attitude(roll_rad=0.2), (0.0, -1.0, 0.0), (math.cos(0.2), 0.0, -math.sin(0.2))),
    ):
        assert messages._body(west, attitude).apply(axis) == pytest.approx(seen)
    down = messages._lens(west, -math.pi / 2)
    assert down.apply((0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))
    level = messages._lens(west, 0.0).apply(np.eye(3))  # of its axes: right, down, ahead
    assert level == pytest.approx(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))


def test_a_site_map_is_kept_at_most_twice_a_second() -> None:
    made, kept = encoder(), []
    for index in range(12):
        moment = raw_moment({**BOARD, "site_map": site_map()})
        at = replace(moment, tick=replace(moment.tick, time_s=1.0 + index / 10))
        if read(made, at).site_map is not None:
            kept.append(index)
    assert kept == [0, 5, 10]


def test_what_is_near_is_kept_with_every_new_map() -> None:
    """Maps are recorded twice a second, near obstacles in every tick."""
    made, first = encoder(), types.NearObstacles(captured_s=1.0)
    then = types.NearObstacles(captured_s=1.1)
    assert read(made, raw_moment({"site_map": map_with(first)})).near is not None
    moment = read(made, raw_moment({"site_map": map_with(then)}))
    assert (moment.site_map, moment.near and moment.near.captured_s) == (None, 1.1)


def test_the_lab_has_a_solid_for_each_object_in_the_colour_of_its_class() -> None:
    outline = Footprint(x_m=1.25, y_m=0.5, half_x_m=0.2, half_y_m=0.2)
    box = Standing(footprint=outline, height_m=1.5, class_id=5)
    empty, one = (
        messages.lab_scene(Ground(size_m=(5.0, 4.0), standing=standing), CLASSES, 0)
        for standing in ((), (box,))
    )
    red = np.float64(CLASSES.colours[5][0] / 255).tobytes()
    assert red in one
    assert np.float64(1.25).tobytes() in one
    assert red not in empty


def test_what_is_perceived_stands_where_the_drone_sees_it() -> None:
    """A mark 1 m ahead of a drone with heading +y lies 1 m up the map."""
    both = messages.perceived_scene(ABOVE, corridor(1.0, "left", nearest_m=0.6), fix(0.0, 0.75), 0)
    assert np.float64(0.75).tobytes() in both
    assert b"mark" not in messages.perceived_scene(ABOVE, corridor(1.0), None, 0)


# --- the writing thread ---------------------------------------------------------------------------

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


def test_a_simulated_flight_waits_for_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
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
