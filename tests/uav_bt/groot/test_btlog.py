"""`.btlog` files: the bytes of FileLogger2; partial and damaged files."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.groot import BtlogReader, BtlogWriter, Transition
from uav_bt.groot.btlog import MAX_XML_BYTES
from uav_bt.groot.transitions import MAX_TIME_US, pack, unpack
from uav_bt.tree import Status

XML = '<root BTCPP_format="4"><BehaviorTree ID="Main"><A _uid="1"/></BehaviorTree></root>'
HEAD = b"BTCPP4-FileLogger2\x01" + struct.pack("<i", len(XML)) + XML.encode()

times = st.integers(min_value=0, max_value=MAX_TIME_US)
uids = st.integers(min_value=0, max_value=0xFFFF)
transitions = st.lists(st.builds(Transition, times, uids, st.sampled_from(Status)), max_size=50)


def write(path: Path, items: list[Transition], first_us: int = 0, xml: str = XML) -> None:
    with BtlogWriter(path) as log:
        log.begin(xml, first_us)
        log.write(items)


def read(path: Path) -> tuple[str, int, list[Transition], int]:
    with BtlogReader(path) as log:
        items = list(log)
        return log.xml, log.first_time_us, items, log.partial_bytes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


def test_the_bytes_are_those_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    items = [
        Transition(1_000_000, 1, Status.RUNNING),
        Transition(1_000_000 + 0x0102030405, 0x0607, Status.FAILURE),
    ]
    write(path, items, first_us=1_000_000)
    assert path.read_bytes() == (
        HEAD
        + struct.pack("<q", 1_000_000)
        + b"\0\0\0\0\0\0\x01\0\x01"
        + b"\x05\x04\x03\x02\x01\0\x07\x06\x03"
    )


@given(items=transitions, xml=st.text(min_size=1), first_us=st.integers(0, 2**60))
def test_what_is_written_is_read(
    folder: Path, items: list[Transition], xml: str, first_us: int
) -> None:
    path = folder / "round.btlog"
    xml = xml.encode(errors="replace").decode()
    dated = [item._replace(time_us=item.time_us + first_us) for item in items]
    write(path, dated, first_us, xml)
    assert read(path) == (xml, first_us, items, 0)


@given(items=transitions, data=st.data())
def test_a_log_cut_short_is_read_as_far_as_it_goes(
    folder: Path, items: list[Transition], data: st.DataObject
) -> None:
    path = folder / "cut.btlog"
    write(path, items)
    whole = path.read_bytes()
    head = len(HEAD) + 8
    kept = data.draw(st.integers(min_value=head, max_value=len(whole)))
    path.write_bytes(whole[:kept])
    records, partial = divmod(kept - head, 9)
    assert read(path) == (XML, 0, items[:records], partial)


@given(kept=st.integers(min_value=0, max_value=len(HEAD) + 7))
def test_a_log_cut_short_in_its_head_is_refused_with_the_byte(folder: Path, kept: int) -> None:
    path = folder / "head.btlog"
    path.write_bytes((HEAD + bytes(8))[:kept])
    with pytest.raises(FileError, match=rf"head.btlog: byte (0|{kept}): "):
        BtlogReader(path)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "byte 0: not a FileLogger2 log"),
        (b"PK\x03\x04 something else entirely", "byte 0: not a FileLogger2 log"),
        (b"BTCPP4-FileLogger2\x02", "byte 18: protocol 2, only 1 can be read"),
        (b"BTCPP4-FileLogger2\x01" + struct.pack("<i", -5), "byte 19: the XML's length"),
        (b"BTCPP4-FileLogger2\x01" + struct.pack("<i", 2**31 - 1), "got 2147483647"),
        (
            b"BTCPP4-FileLogger2\x01" + struct.pack("<i", 3) + b"a\xff\xff",
            "byte 24: the XML is not",
        ),
        (HEAD + bytes(8) + bytes(9) + bytes(8) + b"\x09", f"byte {len(HEAD) + 25}: a status is"),
    ],
)
def test_a_foreign_or_damaged_file_is_refused_with_the_byte(
    tmp_path: Path, data: bytes, words: str
) -> None:
    path = tmp_path / "bad.btlog"
    path.write_bytes(data)
    with pytest.raises(FileError) as error:
        read(path)
    assert words in str(error.value)


def test_a_log_needs_a_name_that_groot2_opens(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"only files named \*\.btlog"):
        BtlogWriter(tmp_path / "flight.log")


def test_a_log_that_cannot_be_written_raises_when_it_begins(tmp_path: Path) -> None:
    log = BtlogWriter(tmp_path / "absent" / "flight.btlog")
    with pytest.raises(FileError, match="cannot be written: No such file"):
        log.begin(XML, 0)


def test_an_older_log_stays_until_the_new_one_begins(tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    path.write_bytes(b"old")
    with BtlogWriter(path) as log:
        assert path.read_bytes() == b"old"
        log.begin(XML, 0)
    assert read(path) == (XML, 0, [], 0)


def test_every_write_is_in_the_file_at_once(tmp_path: Path) -> None:
    """An interrupted mission leaves a log."""
    path = tmp_path / "flight.btlog"
    with BtlogWriter(path) as log:
        log.begin(XML, 0)
        log.write([Transition(5, 1, Status.SUCCESS)])
        assert read(path)[2] == [Transition(5, 1, Status.SUCCESS)]


def test_a_log_is_begun_once_and_before_it_is_written(tmp_path: Path) -> None:
    with BtlogWriter(tmp_path / "flight.btlog") as log:
        with pytest.raises(FileError, match="has not begun"):
            log.write([])
        log.begin(XML, 0)
        with pytest.raises(FileError, match="has begun already"):
            log.begin(XML, 0)


def test_a_tree_too_large_for_a_log_is_refused(tmp_path: Path) -> None:
    with (
        BtlogWriter(tmp_path / "flight.btlog") as log,
        pytest.raises(FileError, match=f"at most {MAX_XML_BYTES} fit"),
    ):
        log.begin("x" * (MAX_XML_BYTES + 1), 0)


def test_a_log_that_grows_too_large_ends_and_is_reported_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "flight.btlog"
    log = BtlogWriter(path, max_bytes=len(HEAD) + 8 + 9 + 8)
    log.begin(XML, 0)
    for time_us in range(3):
        log.write([Transition(time_us, 1, Status.SUCCESS)])
    with pytest.raises(FileError, match="ends early: it is too large"):
        log.close()
    log.close()  # the error is raised only once
    assert len(read(path)[2]) == 1


def test_a_full_disk_ends_the_log_not_the_mission(tmp_path: Path) -> None:
    class Full(io.RawIOBase):
        def write(self, _: Any) -> int:
            raise OSError(28, "No space left on device")

    log = BtlogWriter(tmp_path / "flight.btlog")
    log.begin(XML, 0)
    whole, log._file = log._file, Full()  # type: ignore[assignment]
    assert whole is not None
    whole.close()
    log.write([Transition(0, 1, Status.SUCCESS)])
    with pytest.raises(RuntimeError, match="the flight's own") as error, log:
        raise RuntimeError("the flight's own")
    assert error.value.__notes__ == [
        f"{tmp_path / 'flight.btlog'}: the log ends early: No space left on device"
    ]


@pytest.mark.parametrize("time_us", [-1, MAX_TIME_US + 1])
def test_a_time_that_does_not_fit_is_refused(time_us: int) -> None:
    with pytest.raises(ValueRangeError, match=f"got {time_us} us"):
        pack([Transition(time_us, 1, Status.IDLE)])


def test_a_record_of_another_length_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="9 bytes, got 8"):
        unpack(bytes(8))
