"""Training data from records: files, frames, and footage in memory."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from perception.depth.training.footage import shrink
from sim_bridge.anafi import anafi_camera
from tests.worlds.footage import frame, state, write_record
from uav_bt.errors import FileError
from uav_bt.learning.dataset import footage_of, records_of
from uav_bt.learning.lab_material import fingerprint
from uav_bt.types import Frame

CAMERA = anafi_camera(64, 36)


def frames(times_s: list[float], *, indices: list[int] | None = None) -> list[Frame]:
    rng = np.random.default_rng(0)
    places = range(len(times_s)) if indices is None else indices
    return [
        frame(rng.integers(0, 256, (36, 64, 3), np.uint8), index, time_s, yaw_rad=0.1 * index)
        for index, time_s in zip(places, times_s, strict=True)
    ]


def test_frames_and_telemetry_are_kept_with_their_own_times(tmp_path: Path) -> None:
    flown = frames([0.05, 0.15, 0.25])
    states = [state(0.1 * tick, 0.4) for tick in range(4)]
    found = footage_of(write_record(tmp_path / "a.mcap", CAMERA, flown, states))
    assert [frame.index for frame in found.frames] == [0, 1, 2]
    assert [frame.captured_s for frame in found.frames] == pytest.approx([0.05, 0.15, 0.25])
    assert found.frames[2].attitude == flown[2].attitude
    np.testing.assert_array_equal(found.frames[1].image, shrink(flown[1].image))
    assert list(found.states) == states
    assert found.camera == CAMERA.resized(320, 256)


def test_early_and_repeated_frames_and_repeated_states_are_left_out(tmp_path: Path) -> None:
    flown = frames([0.05 * at for at in range(9)])
    found = footage_of(write_record(tmp_path / "a.mcap", CAMERA, flown, [state(0.0)]))
    assert [frame.index for frame in found.frames] == [0, 2, 4, 6, 8]
    flown = frames([0.1, 0.3, 0.5], indices=[7, 7, 8])
    states = [state(0.1), state(0.1), state(0.2)]
    found = footage_of(write_record(tmp_path / "b.mcap", CAMERA, flown, states))
    assert [frame.index for frame in found.frames] == [7, 8]
    assert [state.captured_s for state in found.states] == [0.1, 0.2]


def test_what_is_no_whole_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"absent\.mcap"):
        footage_of(tmp_path / "absent.mcap")
    with pytest.raises(FileError, match="no frame with an image"):
        footage_of(write_record(tmp_path / "blind.mcap", CAMERA, [], [state(0.0)]))
    path = write_record(tmp_path / "cut.mcap", CAMERA, frames([0.0]), [], finished=False)
    with pytest.raises(FileError, match="never finished; `mcap recover`"):
        footage_of(path)
    path = write_record(tmp_path / "a.mcap", CAMERA, frames([0.0, 0.1]), [state(0.0)])
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"a\.mcap.*damaged"):
        footage_of(path)


def test_a_folder_stands_for_all_records_below_it(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    record = write_record(tmp_path / "a" / "flight.mcap", CAMERA, [], [])
    assert records_of([tmp_path, record]) == [record]
    (tmp_path / "b").mkdir()
    with pytest.raises(FileError, match="no flight record in this folder"):
        records_of([tmp_path / "b"])


def test_a_copy_has_the_same_fingerprint(tmp_path: Path) -> None:
    path = write_record(tmp_path / "a.mcap", CAMERA, [], [state(0.0)])
    assert fingerprint(Path(shutil.copy(path, tmp_path / "b.mcap"))) == fingerprint(path)
    other = write_record(tmp_path / "c.mcap", CAMERA, [], [state(1.0)])
    assert fingerprint(other) != fingerprint(path)
