"""Reading a record from its beginning, past damaged chunks, to the place where it was cut.

The MCAP library reads the records; this module opens the chunks, skips damaged ones, and bounds
how far they may grow.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import replace
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


def is_finished(path: Path) -> bool:
    """Return whether a record was closed, and so has index and summary; FileError if it is none."""
    with reading(path), path.open("rb") as stream:
        _check_magic(stream, path)
        stream.seek(0, 2)
        if stream.tell() < 2 * len(_MAGIC) + _FOOTER_BYTES:
            return False
        stream.seek(-len(_MAGIC) - _FOOTER_BYTES, 2)
        tail = stream.read()
    return tail.endswith(_MAGIC) and tail[0] == Opcode.FOOTER


class RecordScan:
    """Passes over the records of a file, with its chunks opened.

    A chunk with a wrong checksum is skipped. A pass ends at the first record that the MCAP
    library cannot read, which is the end of a file that was cut.

    Attributes:
        damages: the damaged places that the last pass has met, one line each.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damages: list[str] = []

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield headers, schemas, channels, messages, metadata and attachments, in file order."""
        return self.records(None, {})

    def records(
        self, chunks: Iterable[ChunkIndex] | None, topics: dict[int, str]
    ) -> Iterator[McapRecord]:
        """Yield the records of all the file, or of chunks of its index, whose topics are known.

        The topics of channels that the pass meets are added, by number.
        """
        self.damages = []
        with reading(self._path), self._path.open("rb") as stream:
            _check_magic(stream, self._path)
            size_bytes = self._path.stat().st_size
            left_bytes = _MAX_CHUNK_BYTES + _MAX_GROWTH * size_bytes
            found = self._all(stream, size_bytes) if chunks is None else _indexed(stream, chunks)
            for offset, record in found:
                inside = [record]
                if isinstance(record, Chunk):
                    try:
                        inside = opened(record, min(left_bytes, _MAX_CHUNK_BYTES))
                    except Exception as error:  # noqa: BLE001 - a damaged chunk raises anything
                        self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
                        continue
                    left_bytes -= record.uncompressed_size
                for one in inside:
                    if isinstance(one, Channel):
                        topics[one.id] = one.topic
                    if isinstance(one, Message) and one.channel_id not in topics:
                        self._note(offset, f"a message on unknown channel {one.channel_id}")
                    else:
                        yield one
        if chunks is None and not self.damages and not is_finished(self._path):
            self._note(size_bytes, "ends without index and summary")

    def _all(self, stream: IO[bytes], size_bytes: int) -> Iterator[tuple[int, McapRecord]]:
        """Yield the records before the index with their offsets."""
        # The library checks each length against the limit before it reads the record.
        records = StreamReader(
            stream, skip_magic=True, emit_chunks=True, record_size_limit=size_bytes
        ).records
        while True:
            offset = stream.tell()
            try:
                record = next(records, None)
            except (EndOfFile, RecordLengthLimitExceeded, struct.error) as error:
                if offset < size_bytes:
                    cut = not isinstance(error, struct.error) or stream.tell() >= size_bytes
                    what = "the file is cut within a record" if cut else "a damaged record"
                    self._note(offset, what)
                return
            except Exception as error:  # noqa: BLE001 - a damaged record raises anything
                self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
                return
            if record is None or isinstance(record, DataEnd):  # the rest repeats what was read
                return
            yield offset, record

    def _note(self, offset: int, reason: str) -> None:
        self.damages.append(f"byte {offset}: {reason}")


def _indexed(stream: IO[bytes], chunks: Iterable[ChunkIndex]) -> Iterator[tuple[int, McapRecord]]:
    for index in chunks:
        stream.seek(index.chunk_start_offset + _HEAD_BYTES)
        yield index.chunk_start_offset, Chunk.read(ReadDataStream(stream))


def opened(chunk: Chunk, max_bytes: int = _MAX_CHUNK_BYTES) -> list[McapRecord]:
    """Return a chunk's records.

    ValueError if it is larger, opened, than `max_bytes` or than it says; its parsers raise others.
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


def _check_magic(stream: IO[bytes], path: Path) -> None:
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise FileError(path, "is not a flight record: expected an MCAP file (*.mcap)")
