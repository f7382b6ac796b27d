"""Windows over time: rhythm, order, targets, pictures that are decoded when asked for."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.utils.data import DataLoader

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.learning.dataset.flight_data import FlightData, read_flight_data
from uav_bt.learning.dataset.images import PictureStore
from uav_bt.learning.dataset.torch_windows import WindowDataset
from uav_bt.learning.dataset.windows import FlightWindows, WindowConfig, windows_of
from uav_bt.record.reader import RecordReader
from uav_bt.testing import pinhole

SMALL = WindowConfig(length=3, stride_s=0.2, size_px=(32, 16), keep_pictures=8)


def times(captured_s: list[float]) -> FlightData:
    """Return a flight of frames at some times, nothing else."""
    count = len(captured_s)
    return FlightData(
        path=Path("none.mcap"),
        camera=pinhole(64, 36),
        scene="",
        outcome="",
        tick_s=np.array(captured_s),
        states=np.zeros((count, 11), np.float32),
        kinds=np.zeros(count, np.int64),
        commands=np.zeros((count, 4), np.float32),
        frame_index=np.arange(count),
        captured_s=np.array(captured_s),
        frame_tick=np.arange(count),
        stored_ns=np.arange(count),
    )


def test_windows_stand_in_their_rhythm() -> None:
    flight = times([0.1 * tick for tick in range(10)])
    found = windows_of(flight, WindowConfig(length=3, stride_s=0.2))
    assert found.tolist() == [[end - 4, end - 2, end] for end in range(4, 10)]


def test_a_gap_ends_windows_and_others_begin_behind_it() -> None:
    flight = times([0.0, 0.1, 0.2, 0.3, 2.0, 2.1, 2.2])
    found = windows_of(flight, WindowConfig(length=3, stride_s=0.1))
    assert found.tolist() == [[0, 1, 2], [1, 2, 3], [4, 5, 6]]


def test_windows_may_end_less_often_than_frames_come() -> None:
    flight = times([0.1 * tick for tick in range(20)])
    found = windows_of(flight, WindowConfig(length=1, every_s=0.5))
    assert found[:, -1].tolist() == [0, 4, 8, 12, 16]  # a frame that is almost due is due


def test_a_single_frame_is_a_window_of_one() -> None:
    assert windows_of(times([3.0]), WindowConfig(length=1)).tolist() == [[0]]
    assert windows_of(times([3.0]), WindowConfig(length=2)).tolist() == []


@given(
    steps=st.lists(st.floats(0.02, 0.4), min_size=1, max_size=40),
    length=st.integers(1, 5),
    stride_s=st.floats(0.05, 0.6),
)
def test_no_window_is_out_of_rhythm_or_order(
    steps: list[float], length: int, stride_s: float
) -> None:
    flight = times(np.cumsum(steps).tolist())
    config = WindowConfig(length=length, stride_s=stride_s)
    for window in windows_of(flight, config):
        seen_s = flight.captured_s[window]
        assert (np.diff(window) > 0).all()
        back_s = seen_s[-1] - seen_s
        wanted_s = stride_s * np.arange(length - 1, -1, -1)
        assert (np.abs(back_s - wanted_s) <= config.tolerance_s + 1e-9).all()


@pytest.mark.parametrize(
    "wrong", [{"length": 0}, {"stride_s": 0.0}, {"every_s": -1.0}, {"keep_pictures": 2}]
)
def test_a_window_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError):
        WindowConfig(**wrong)  # type: ignore[arg-type]


def test_a_window_has_the_recorded_frames_states_and_command(record: Path) -> None:
    flight = read_flight_data(record)
    windows = FlightWindows([flight], SMALL)
    moments = list(RecordReader(record).moments())
    window = windows[5]
    places = windows_of(flight, SMALL)[5]
    for image, place in zip(window.frames, places, strict=True):
        stored = moments[int(flight.frame_tick[place])].frame
        assert stored is not None
        whole = stored.frame().image
        expected = cv2.resize(whole, (32, 16), interpolation=cv2.INTER_AREA)
        np.testing.assert_array_equal(image, expected)
    last = int(flight.frame_tick[places[-1]])
    assert window.kind == flight.kinds[last]
    np.testing.assert_array_equal(window.command, flight.commands[last])
    np.testing.assert_array_equal(window.states[-1], flight.states[last])
    assert windows.kinds[5] == window.kind
    assert len(windows.kinds) == len(windows)


def test_windows_of_several_flights_follow_one_another(record: Path) -> None:
    flight = read_flight_data(record)
    one, two = FlightWindows([flight], SMALL), FlightWindows([flight, flight], SMALL)
    assert len(two) == 2 * len(one)
    assert [two[0].flight, two[len(one)].flight] == [0, 1]
    with pytest.raises(IndexError):
        two[len(two)]


def test_flights_of_another_camera_are_refused(record: Path) -> None:
    flight = read_flight_data(record)
    other = replace(flight, camera=pinhole(100, 50), path=Path("other.mcap"))
    with pytest.raises(FileError, match=r"other\.mcap.*another camera"):
        FlightWindows([flight, other], SMALL)


def test_flights_that_are_too_short_are_refused(record: Path) -> None:
    with pytest.raises(ValueRangeError, match="no window"):
        FlightWindows([read_flight_data(record)], WindowConfig(length=100, stride_s=1.0))
    with pytest.raises(ValueRangeError, match="no window"):
        FlightWindows([], SMALL)


def test_only_the_last_pictures_are_kept(record: Path) -> None:
    flight = read_flight_data(record)
    store = PictureStore((32, 16), keep=3)
    first = store.picture(flight, 0)
    assert store.picture(flight, 0) is first
    for place in (1, 2, 3):
        store.picture(flight, place)
    again = store.picture(flight, 0)
    assert again is not first
    np.testing.assert_array_equal(again, first)


def test_a_record_that_was_replaced_is_noticed(record: Path) -> None:
    flight = read_flight_data(record)
    moved = replace(flight, stored_ns=flight.stored_ns + 1)
    with pytest.raises(FileError, match="replaced"):
        PictureStore((32, 16)).picture(moved, 0)


def test_items_are_tensors(record: Path) -> None:
    item = WindowDataset([record], SMALL)[0]
    assert item["frames"].shape == (3, 3, 16, 32)
    assert item["frames"].dtype is torch.uint8
    assert item["states"].shape == (3, 11)
    assert item["command"].shape == (4,)
    assert (item["kind"].dtype, item["flight"].dtype) == (torch.int64, torch.int64)


def test_another_process_gets_the_same_items_and_none_of_the_pictures(record: Path) -> None:
    data = WindowDataset([record], SMALL)
    first = data[0]
    packed = pickle.dumps(data)  # what torch does to hand a data set to its workers
    assert len(packed) < 100_000
    again = pickle.loads(packed)[0]  # noqa: S301  # our own bytes, of the line above
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_batches_come_in_a_fixed_order(record: Path) -> None:
    data = WindowDataset([record], SMALL)
    batches = [batch["command"] for batch in DataLoader(data, batch_size=7)]
    expected = torch.stack([data[place]["command"] for place in range(len(data))])
    assert torch.equal(torch.cat(batches), expected)
