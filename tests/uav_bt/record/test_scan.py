"""Records of killed flights and damaged files: intact parts are read, damage is reported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from tests.worlds.processes import ROOT, python
from tests.worlds.records import copy_part, fly_noisy
from uav_bt.errors import FileError
from uav_bt.record.info import record_info
from uav_bt.record.playback import Playback
from uav_bt.record.reader import RecordReader, footage

# A flight that kills its process in a tick, like `kill -9`, without closing or flushing files.
KILLED = """
import os, signal, sys
from pathlib import Path
sys.path[0] = {here!r}
from tests.worlds.records import NoisyDrone
from tests.worlds.trees import tree_file
from uav_bt import app

class Kill:
    def on_tick(self, record):
        if record.index == 120:
            os.kill(os.getpid(), signal.SIGKILL)

folder = Path({folder!r})
body = '<Sequence><TakeOff height_m="1.5"/><HoverFor seconds="60"/><Land/></Sequence>'
app.fly(
    tree_file(folder, body),
    drone=NoisyDrone(),
    record=folder / "flight.mcap",
    listeners=[lambda flight: [Kill()]],
)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as monkeypatch:
        return fly_noisy(tmp_path_factory.mktemp("whole"), monkeypatch)[0]


def moments_of(path: Path) -> list[float]:
    return [moment.tick.time_s for moment in RecordReader(path).moments()]


def test_a_killed_flight_leaves_a_record_that_is_read_and_can_be_recovered(tmp_path: Path) -> None:
    code = KILLED.format(here=str(ROOT), folder=str(tmp_path))
    done = python("-c", code)
    assert done.returncode == -9, done.stderr
    record = tmp_path / "flight.mcap"
    times = moments_of(record)
    assert times == pytest.approx([0.1 * index for index in range(len(times))])
    info = record_info(record)
    assert not info["finished"]
    assert info["end"] is None
    assert info["damages"]
    recovered = tmp_path / "recovered.mcap"
    copy_part(record, recovered)
    assert moments_of(recovered) == times
    again = record_info(recovered)
    assert (again["finished"], again["damages"], again["end"]) == (True, (), None)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_record_cut_anywhere_is_read_so_far(share: float, whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    everything = moments_of(whole)
    try:
        reader = RecordReader(cut)
    except FileError:
        assert share < 0.1  # even the flight's metadata is missing
        return
    assert not reader.finished
    times = [moment.tick.time_s for moment in reader.moments()]
    assert times == everything[: len(times)]
    assert reader.damages


def test_a_damaged_chunk_is_skipped_and_reported(whole: Path, tmp_path: Path) -> None:
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    data = bytearray(whole.read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    info = record_info(damaged)
    assert len(info["damages"]) == 1
    assert "damaged record" in info["damages"][0]
    everything, left = moments_of(whole), moments_of(damaged)
    assert 0 < len(left) < len(everything)
    assert set(left) < set(everything)
    part = RecordReader(damaged)
    times_s = [moment.tick.time_s for moment in part.moments(from_s=0.05)]
    assert times_s == [time_s for time_s in left if time_s > 0.04]
    assert part.damages == info["damages"]


def test_a_file_of_mcap_that_is_no_record_is_refused(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    with pytest.raises(FileError, match="an MCAP file, but no flight record"):
        RecordReader(foreign)


@pytest.mark.parametrize(
    ("name", "metadata", "problem"),
    [
        ("uav_bt.flight", {"start_ns": "1e999"}, "the metadata of the record is damaged"),
        ("uav_bt.flight", {"start_s": "x"}, "the metadata of the record is damaged"),
        ("uav_bt.flight", {"camera_model": "[" * 5000}, "metadata of the record .* no JSON"),
        ("uav_bt.end", {"dropped": "[]"}, "the end of the record is damaged"),
        ("uav_bt.end", {"dropped": "{"}, "the end of the record is damaged: no JSON"),
        ("uav_bt.end", {"lost_ticks": "many"}, "the end of the record is damaged"),
    ],
)
def test_damaged_metadata_is_named(
    whole: Path, tmp_path: Path, name: str, metadata: dict[str, str], problem: str
) -> None:
    path = tmp_path / "damaged.mcap"
    copy_part(whole, path, metadata={name: metadata})
    with pytest.raises(FileError, match=problem):
        record_info(path)


@pytest.mark.parametrize(
    ("topic", "data"),
    [
        ("/mission/board", b"[1]"),
        ("/mission/board", b'{"phase": 1}'),
        ("/mission/board", b"[" * 5000),
        ("/mission/tick", b'{"index": 1e999}'),
        ("/mission/tick", b"\xff"),
        ("/tree/status", b'{"statuses": ["GREEN"]}'),
        ("/drone/state", b'{"captured_s": ' + b"9" * 400 + b"}"),
        ("/mission/board", b'{"phase": {"value": 3, "captured_s": 0.0}}'),
        ("/mission/board", b'{"phase": {"value": "x", "captured_s": "Mission/x"}}'),
        ("/mission/commands", b'{"override": "mutiny"}'),
        ("/camera/image", b"\x12\x04GIF8"),
    ],
)
def test_damaged_messages_are_errors(whole: Path, tmp_path: Path, topic: str, data: bytes) -> None:
    path = tmp_path / "damaged.mcap"
    copy_part(whole, path, messages={topic: data})
    with pytest.raises(FileError, match=f"^{path}: .*tick.* of the record is damaged: "):
        list(Playback(RecordReader(path)).ticks())
    if topic == "/drone/state":
        with pytest.raises(FileError, match=f"^{path}: a message of the record is damaged: "):
            list(footage(RecordReader(path)))


@pytest.mark.parametrize(
    "layout",
    [{"extras_last": True}, {"chunks": False}, {"order": lambda item: (item[1].log_time, item[0])}],
    ids=["extras last", "without chunks", "a time's messages by topic"],
)
def test_a_record_in_another_legal_layout_is_the_same_record(
    whole: Path, tmp_path: Path, layout: dict[str, Any]
) -> None:
    other = copy_part(whole, tmp_path / "other.mcap", **layout)
    first, second = RecordReader(whole), RecordReader(other)
    assert second.metadata == first.metadata
    assert second.attachments == first.attachments
    assert second.tree == first.tree
    assert second.end == first.end
    assert second.damages == ()
    assert moments_of(other) == moments_of(whole)
    for ours, theirs in zip(first.moments(), second.moments(), strict=True):
        assert (ours.commands, ours.statuses) == (theirs.commands, theirs.statuses)
    part = [moment.tick.time_s for moment in second.moments(from_s=1.0, to_s=2.0)]
    assert part == [moment.tick.time_s for moment in first.moments(from_s=1.0, to_s=2.0)]


def test_messages_out_of_order_name_the_remedy(whole: Path, tmp_path: Path) -> None:
    other = copy_part(whole, tmp_path / "by_topic.mcap", order=lambda item: item[0])
    with pytest.raises(FileError, match=r"not in the order of time.*`mcap sort`"):
        moments_of(other)
