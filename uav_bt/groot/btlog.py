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
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, Self

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import reading, writing
from uav_bt.groot.transitions import RECORD_BYTES, Transition, pack, unpack

SUFFIX: Final = ".btlog"  # the only suffix that Groot2 opens
MAX_XML_BYTES: Final = 32 * 1024 * 1024  # twice the size of a tree of 65,535 nodes
MAX_LOG_BYTES: Final = 1024**3  # weeks of a large tree at ten ticks a second

_MAGIC: Final = b"BTCPP4-FileLogger2"
_PROTOCOL: Final = 1
_XML_LENGTH: Final = struct.Struct("<i")
_FIRST_TIME: Final = struct.Struct("<q")


class BtlogWriter:
    """Writes a log during a flight. Use it as a context manager, or close it.

    Each `write` reaches the operating system, so that an interrupted mission leaves a log. A full
    disk ends the log, not the mission; `close` then raises the error.

    Args:
        path: the file; an existing one is replaced.
        max_bytes: size limit of the file, at which the log ends.

    Raises:
        FileError: the name is not `*.btlog`.
    """

    def __init__(self, path: Path, *, max_bytes: int = MAX_LOG_BYTES) -> None:
        if path.suffix != SUFFIX:
            raise FileError(path, f"Groot2 opens only files named *{SUFFIX}; choose such a name")
        self._path = path
        self._room_bytes = max_bytes
        self._first_time_us: int | None = None
        self._fault: FileError | None = None
        self._file: BinaryIO | None = None

    def begin(self, xml: str, first_time_us: int) -> None:
        """Open the file and write the head of the log.

        An existing file is not changed before this call.

        Args:
            xml: the numbered tree.
            first_time_us: mission time, microseconds; transitions must not be earlier.

        Raises:
            FileError: the file cannot be written, the log has already begun, or the tree is too
                large.
        """
        if self._first_time_us is not None:
            raise FileError(self._path, "this log has begun already; write another file")
        data = xml.encode()
        if len(data) > MAX_XML_BYTES:
            raise FileError(
                self._path, f"the tree's XML has {len(data)} bytes, at most {MAX_XML_BYTES} fit"
            )
        with writing(self._path):
            self._file = self._path.open("wb", buffering=0)
        self._first_time_us = first_time_us
        head = _MAGIC + bytes([_PROTOCOL]) + _XML_LENGTH.pack(len(data)) + data
        self._put(head + _FIRST_TIME.pack(first_time_us))

    def write(self, transitions: Iterable[Transition]) -> None:
        """Append transitions, in the order of their times.

        Raises:
            FileError: the log has not begun.
            ValueRangeError: a transition is earlier than the first time.
        """
        if self._first_time_us is None:
            raise FileError(self._path, "this log has not begun: call begin() first")
        self._put(pack(transitions, self._first_time_us))

    def close(self) -> None:
        """Finish the file; safe to call twice.

        Raises:
            FileError: the log is incomplete, because the disk failed or the file was too large.
        """
        if self._file is not None:
            self._file.close()
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    def _put(self, data: bytes) -> None:
        if self._file is None or self._fault is not None:
            return
        if len(data) > self._room_bytes:
            self._fault = FileError(self._path, "the log ends early: it is too large")
            return
        self._room_bytes -= len(data)
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._fault = FileError(self._path, f"the log ends early: {error.strerror}")

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file; an earlier exception has priority over an error of the log."""
        try:
            self.close()
        except FileError as second:
            if error is None:
                raise
            error.add_note(str(second))


class BtlogReader:
    """Reads the transitions of a log. Use it as a context manager, or close it.

    A log that ends within a transition is read up to the last complete one; `partial_bytes` is the
    size of the rest.

    Args:
        path: the file.

    Raises:
        FileError: the file is missing or is not a log; the message contains the byte offset.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.partial_bytes = 0  # size of a partial transition at the end, after all were read
        with reading(path):
            size = path.stat().st_size
            if size > MAX_LOG_BYTES:
                raise FileError(path, f"has {size} bytes, more than a log's {MAX_LOG_BYTES}")
            self._file: BinaryIO = path.open("rb")
        try:
            self.xml, self.first_time_us = self._head()
        except BaseException:
            self._file.close()
            raise

    def __iter__(self) -> Iterator[Transition]:
        """Yield the remaining transitions; their times start at 0 with the log.

        Raises:
            FileError: a record is invalid; the message contains its byte offset.
        """
        while len(record := self._file.read(RECORD_BYTES)) == RECORD_BYTES:
            try:
                transition = unpack(record)
            except ValueRangeError as error:
                raise self._bad(self._file.tell() - 1, str(error)) from error
            yield transition
        self.partial_bytes = len(record)

    def close(self) -> None:
        """Close the file; safe to call twice."""
        self._file.close()

    def _head(self) -> tuple[str, int]:
        if self._file.read(len(_MAGIC)) != _MAGIC:
            raise self._bad(0, f"not a FileLogger2 log, which begins with '{_MAGIC.decode()}'")
        protocol = self._bytes(1, "the protocol's number")[0]
        if protocol != _PROTOCOL:
            at = self._file.tell() - 1
            raise self._bad(at, f"protocol {protocol}, only {_PROTOCOL} can be read")
        at = self._file.tell()
        (length,) = _XML_LENGTH.unpack(self._bytes(_XML_LENGTH.size, "the XML's length"))
        if not 0 < length <= MAX_XML_BYTES:
            raise self._bad(
                at, f"the XML's length must lie within 1 and {MAX_XML_BYTES} bytes, got {length}"
            )
        at = self._file.tell()
        try:
            xml = self._bytes(length, "the XML").decode()
        except UnicodeDecodeError as error:
            raise self._bad(at + error.start, "the XML is not UTF-8") from error
        (first_time_us,) = _FIRST_TIME.unpack(self._bytes(_FIRST_TIME.size, "the first time"))
        return xml, first_time_us

    def _bytes(self, count: int, what: str) -> bytes:
        data = self._file.read(count)
        if len(data) < count:
            raise self._bad(self._file.tell(), f"the file ends within {what}")
        return data

    def _bad(self, offset: int, message: str) -> FileError:
        return FileError(self._path, f"byte {offset}: {message}")

    def __enter__(self) -> Self:
        """Return the reader."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()
