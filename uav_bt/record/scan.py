"""Reading a record from its beginning, past damaged chunks, to the place where it was cut.

The MCAP library reads the records; this module opens the chunks, skips damaged ones, and bounds
how far they may grow.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Final

from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, McapRecord, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdDecompressor

from uav_bt.errors import FileError
from uav_bt.files import reading

_MAGIC: Final = bytes((0x89, 0x4D, 0x43, 0x41, 0x50, 0x30, 0x0D, 0x0A))
_HEAD_BYTES: Final = 9  # opcode and length of a record, by the MCAP specification
_FOOTER_BYTES: Final = _HEAD_BYTES + 20  # by the MCAP specification
# Our chunks have 4 MiB and the rest of a burst; chosen eight times as large.
_MAX_CHUNK_BYTES: Final = 32 * 1024 * 1024
# Opened bytes per byte of the file; chosen so that hours of one black image can be opened.
_MAX_GROWTH: Final = 100


@dataclass(frozen=True, kw_only=True)
class Damage:
    """A damaged place in a record."""

    offset: int  # bytes from the beginning of the file
    reason: str

    def __str__(self) -> str:
        """Return the place and the reason in one line."""
        return f"byte {self.offset}: {self.reason}"


def is_finished(path: Path) -> bool:
    """Return whether a record was closed, and so has index and summary.

    Raises:
        FileError: the file cannot be read or is not an MCAP file.
    """
    with reading(path), path.open("rb") as stream:
        _check_magic(stream, path)
        stream.seek(0, 2)
        if stream.tell() < 2 * len(_MAGIC) + _FOOTER_BYTES:
            return False
        stream.seek(-len(_MAGIC) - _FOOTER_BYTES, 2)
        tail = stream.read()
    return tail.endswith(_MAGIC) and tail[0] == Opcode.FOOTER


class RecordScan:
    """One pass over the records of a file, with its chunks opened.

    A chunk with a wrong checksum is skipped. The pass ends at the first record that the MCAP
    library cannot read, which is the end of a file that was cut.

    Args:
        path: the file.

    Attributes:
        damages: the damaged places that the pass has met.
        finished: whether the pass reached an end with index and summary.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damages: list[Damage] = []
        self.finished = False

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield headers, schemas, channels, messages, metadata and attachments, in file order.

        Raises:
            FileError: the file cannot be read or is not an MCAP file.
        """
        self.damages, self.finished = [], False
        with reading(self._path), self._path.open("rb") as stream:
            _check_magic(stream, self._path)
            known: set[int] = set()
            for offset, record in self._records(stream):
                if isinstance(record, Channel):
                    known.add(record.id)
                if isinstance(record, Message) and record.channel_id not in known:
                    self._note(offset, f"a message on unknown channel {record.channel_id}")
                else:
                    yield record
        if not self.finished and not self.damages:
            self._note(self._path.stat().st_size, "ends without index and summary")

    def _records(self, stream: IO[bytes]) -> Iterator[tuple[int, McapRecord]]:
        """Yield the records before the index, each with the offset of itself or its chunk."""
        allowance = _Allowance(self._path)
        size = self._path.stat().st_size
        # The library checks each length against the limit before it reads the record.
        records = StreamReader(
            stream, skip_magic=True, emit_chunks=True, record_size_limit=size
        ).records
        while True:
            offset = stream.tell()
            try:
                record = next(records)
            except (EndOfFile, RecordLengthLimitExceeded, struct.error) as error:
                if offset < size:
                    cut = not isinstance(error, struct.error) or stream.tell() >= size
                    what = "the file is cut within a record" if cut else "a damaged record"
                    self._note(offset, what)
                return
            except Exception as error:  # noqa: BLE001 - a damaged record raises anything
                self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
                return
            if isinstance(record, DataEnd):
                # The rest repeats data that was read. A footer shows that it is complete.
                self.finished = is_finished(self._path)
                return
            if not isinstance(record, Chunk):
                yield offset, record
                continue
            try:
                inside = allowance.opened(record)
            except Exception as error:  # noqa: BLE001 - a damaged chunk raises anything
                self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
                continue
            yield from ((offset, one) for one in inside)

    def _note(self, offset: int, reason: str) -> None:
        self.damages.append(Damage(offset=offset, reason=reason))


def opened(chunk: Chunk, max_bytes: int = _MAX_CHUNK_BYTES) -> list[McapRecord]:
    """Return a chunk's records.

    Args:
        chunk: the chunk as the file has it.
        max_bytes: limit of the opened size.

    Raises:
        ValueError: the chunk is larger than the limit or than its size field; its parsers
            raise further exceptions.
    """
    size = chunk.uncompressed_size
    if size > max_bytes:
        raise ValueError(f"a chunk of {size} bytes, opened, more than {max_bytes}")
    if chunk.compression == "zstd":
        data = ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    elif chunk.compression == "lz4":
        data = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression:
        raise ValueError(f"a chunk compressed by '{chunk.compression:.20}'")
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError(f"a chunk of {size} bytes has {len(data)} or more")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def indexed_chunks(stream: IO[bytes], indices: Iterable[ChunkIndex]) -> Iterator[list[McapRecord]]:
    """Yield the records of some of a file's chunks.

    Args:
        stream: the open file.
        indices: the index entries of the chunks.

    Raises:
        ValueError: a chunk is too large or damaged; its parsers raise further exceptions.
    """
    allowance = _Allowance(Path(stream.name))
    for index in indices:
        stream.seek(index.chunk_start_offset + _HEAD_BYTES)
        yield allowance.opened(Chunk.read(ReadDataStream(stream)))


class _Allowance:
    """The number of bytes to which the chunks of a file may still grow."""

    def __init__(self, path: Path) -> None:
        self._left_bytes = _MAX_CHUNK_BYTES + _MAX_GROWTH * path.stat().st_size

    def opened(self, chunk: Chunk) -> list[McapRecord]:
        """Return a chunk's records; raises as `opened` does."""
        records = opened(chunk, min(self._left_bytes, _MAX_CHUNK_BYTES))
        self._left_bytes -= chunk.uncompressed_size
        return records


def _check_magic(stream: IO[bytes], path: Path) -> None:
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise FileError(path, "is not a flight record: expected an MCAP file (*.mcap)")
