"""`.btlog` files: the bytes of FileLogger2, written at once, up to a full disk."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import pytest

from uav_bt.errors import FileError
from uav_bt.groot.transitions import BtlogWriter, Transition
from uav_bt.tree import Status

XML = '<root BTCPP_format="4"><BehaviorTree ID="Main"><A _uid="1"/></BehaviorTree></root>'
HEAD = b"BTCPP4-FileLogger2\x01" + struct.pack("<i", len(XML)) + XML.encode()


def test_the_bytes_are_those_of_the_format_and_written_at_once(tmp_path: Path) -> None:
    """An interrupted mission leaves a log; an older one stays until the new one begins."""
    path = tmp_path / "flight.btlog"
    path.write_bytes(b"old")
    with BtlogWriter(path) as log:
        assert path.read_bytes() == b"old"
        log.begin(XML, 1_000_000)
        log.write([Transition(1_000_000, 1, Status.RUNNING)])
        log.write([Transition(1_000_000 + 0x010203040506, 0x0607, Status.FAILURE)])
        assert path.read_bytes() == (
            HEAD
            + struct.pack("<q", 1_000_000)
            + b"\0\0\0\0\0\0\x01\0\x01"
            + b"\x06\x05\x04\x03\x02\x01\x07\x06\x03"
        )
        with pytest.raises(FileError, match="has begun already"):
            log.begin(XML, 0)


def test_a_log_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"only files named \*\.btlog"):
        BtlogWriter(tmp_path / "flight.log")
    log = BtlogWriter(tmp_path / "absent" / "flight.btlog")
    with pytest.raises(FileError, match="cannot be written: No such file"):
        log.begin(XML, 0)


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
