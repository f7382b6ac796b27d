"""What is read of a record beside its pictures, and the index that keeps it."""

from __future__ import annotations

import os
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from uav_bt.errors import FileError
from uav_bt.learning.dataset import index_file
from uav_bt.learning.dataset.commands import MOVEMENT_KINDS, kind_of, values_of
from uav_bt.learning.dataset.flight_data import STATE_FIELDS, FlightData, read_flight_data
from uav_bt.learning.dataset.index_file import flight_data, index_path
from uav_bt.record.reader import RecordReader
from uav_bt.types import CutMotors, Hover, Land, MoveBy, Movement, Release, TakeOff, Velocity


@pytest.mark.parametrize(
    ("movement", "kind", "values"),
    [
        (Hover(), "hover", (0, 0, 0, 0)),
        (TakeOff(), "take_off", (0, 0, 0, 0)),
        (Land(), "land", (0, 0, 0, 0)),
        (CutMotors(), "cut_motors", (0, 0, 0, 0)),
        (Release(), "release", (0, 0, 0, 0)),
        (MoveBy(id=1, forward_m=1, right_m=2, down_m=3, yaw_rad=4), "move_by", (1, 2, 3, 4)),
        (
            Velocity(forward_mps=1, right_mps=2, down_mps=3, yaw_rate_radps=4),
            "velocity",
            (1, 2, 3, 4),
        ),
    ],
)
def test_movements_are_numbers(movement: Movement, kind: str, values: tuple[float, ...]) -> None:
    assert MOVEMENT_KINDS[kind_of(movement)] == kind
    assert values_of(movement).tolist() == list(values)


def test_flight_data_are_what_the_record_says(record: Path) -> None:
    data = read_flight_data(record)
    moments = list(RecordReader(record).moments())
    assert data.tick_s.tolist() == [moment.tick.time_s for moment in moments]
    assert data.kinds.tolist() == [kind_of(moment.commands.sent.movement) for moment in moments]
    heights = data.states[:, STATE_FIELDS.index("height_above_carpet_m")]
    told = [moment.state.height_above_carpet_m for moment in moments]
    np.testing.assert_allclose(heights, told, rtol=1e-6)
    framed = [place for place, moment in enumerate(moments) if moment.frame is not None]
    assert data.frame_tick.tolist() == framed
    assert len(data) == len(framed) > 20
    assert data.states.shape == (len(moments), len(STATE_FIELDS))


def same(one: FlightData, other: FlightData) -> bool:
    def plain(value: object) -> object:
        return value.tolist() if isinstance(value, np.ndarray) else value

    return all(
        plain(getattr(one, item.name)) == plain(getattr(other, item.name))
        for item in fields(FlightData)
    )


class Counted:
    """Reads records and counts how often."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.times = 0
        monkeypatch.setattr(index_file, "read_flight_data", self)

    def __call__(self, path: Path) -> FlightData:
        self.times += 1
        return read_flight_data(path)


def test_an_index_saves_reading_the_record(record: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Counted(monkeypatch)
    first = flight_data(record)
    assert index_path(record).is_file()
    assert same(flight_data(record), first)
    assert counted.times == 1
    assert sorted(file.name for file in record.parent.iterdir()) == [
        "flight.mcap",
        "flight.mcap.index.npz",
    ]


def test_an_index_of_another_state_is_made_anew(
    record: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted = Counted(monkeypatch)
    flight_data(record)
    told = record.stat()
    os.utime(record, ns=(told.st_atime_ns, told.st_mtime_ns + 1))
    flight_data(record)
    assert counted.times == 2


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK\x03\x04broken"])
def test_a_damaged_index_is_made_anew(
    content: bytes, record: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted = Counted(monkeypatch)
    first = flight_data(record)
    index_path(record).write_bytes(content)
    assert same(flight_data(record), first)
    assert counted.times == 2


def test_indices_of_one_name_in_one_folder_do_not_meet(record: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = Path(shutil.copy(record, tmp_path / "other"))
    places = {index_path(path, tmp_path / "indices") for path in (record, other)}
    assert len(places) == 2
    flight_data(record, tmp_path / "indices")
    assert index_path(record, tmp_path / "indices").is_file()
    assert not index_path(record).exists()


def test_a_folder_that_cannot_hold_an_index_costs_time_only(
    record: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    taken = tmp_path / "file"
    taken.write_bytes(b"")
    assert len(flight_data(record, taken)) > 20
    assert "cannot be kept" in caplog.text


def test_an_unfinished_record_asks_to_be_repaired(record: Path) -> None:
    whole = record.read_bytes()
    record.write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(FileError, match="mcap recover"):
        flight_data(record)


def test_a_damaged_record_is_refused(record: Path) -> None:
    content = bytearray(record.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 64] = bytes(64)
    record.write_bytes(content)
    with pytest.raises(FileError, match="damaged"):
        flight_data(record)


@pytest.mark.parametrize("content", [b"", b"no record at all"])
def test_what_is_no_record_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    path.write_bytes(content)
    with pytest.raises(FileError):
        flight_data(path)
    with pytest.raises(FileError, match="cannot be read"):
        flight_data(tmp_path / "absent.mcap")
