"""Log files in the FileLogger2 format of BehaviorTree.CPP, which Groot2 replays.

Source: BehaviorTree.CPP's `bt_file_logger_v2.cpp`. All numbers are little endian:

    18 bytes   BTCPP4-FileLogger2
    u8         protocol, 1
    i32        length of the XML
    bytes      the tree as XML, with `_uid` of every node
    i64        first time, microseconds, by the mission clock
    9 bytes    each transition, with its time since the first time
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, Final, Self

from uav_bt.errors import FileError
from uav_bt.files import writing
from uav_bt.groot.transitions import Transition, pack

SUFFIX: Final = ".btlog"  # the only suffix that Groot2 opens

_MAGIC: Final = b"BTCPP4-FileLogger2\x01"


class BtlogWriter:
    """Writes a log during a flight. Use it as a context manager.

    Each `write` reaches the operating system, so that an interrupted mission leaves a log. A full
    disk ends the log, not the mission; the end of the context then raises the error. An existing
    file is replaced, not before `begin`.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix != SUFFIX:
            raise FileError(path, f"Groot2 opens only files named *{SUFFIX}; choose such a name")
        self._path = path
        self._first_time_us = 0
        self._fault: FileError | None = None
        self._file: BinaryIO | None = None

    def begin(self, xml: str, first_time_us: int) -> None:
        """Open the file and write its head: the numbered tree, and the mission time."""
        if self._file is not None:
            raise FileError(self._path, "this log has begun already; write another file")
        with writing(self._path):
            self._file = self._path.open("wb", buffering=0)
        self._first_time_us = first_time_us
        data = xml.encode()
        self._put(_MAGIC + struct.pack("<i", len(data)) + data + struct.pack("<q", first_time_us))

    def write(self, transitions: Iterable[Transition]) -> None:
        """Append transitions, in the order of their times."""
        self._put(pack(transitions, self._first_time_us))

    def _put(self, data: bytes) -> None:
        if self._file is None or self._fault is not None:
            return
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._fault = FileError(self._path, f"the log ends early: {error.strerror}")

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Close the file; an earlier exception has priority over an error of the log."""
        if self._file is not None:
            self._file.close()
        if self._fault is not None and error is None:
            raise self._fault
        if self._fault is not None and error is not None:
            error.add_note(str(self._fault))
