"""Reading a record from its beginning to wherever it is whole, whatever happened to the rest.

MCAP is a row of records, each with a kind and a length. A file that was cut ends within one; a
damaged chunk does not have the checksum it should have and is passed over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import IO, Final

from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import breakup_chunk
from zstandard import ZstdDecompressor

from uav_bt.errors import FileError
from uav_bt.files import reading

_MAGIC: Final = bytes((0x89, 0x4D, 0x43, 0x41, 0x50, 0x30, 0x0D, 0x0A))
_HEAD_BYTES: Final = 9  # kind, and length
_FOOTER_BYTES: Final = _HEAD_BYTES + 20
# Our chunks have 4 MiB and the rest of a burst. A whole file, of which hours are one black image,
# may grow by the second factor when it is opened; what grows more was made to fill the memory.
_MAX_CHUNK_BYTES: Final = 32 * 1024 * 1024
_MAX_GROWTH: Final = 100
_READERS: Final[dict[int, Callable[[ReadDataStream], McapRecord]]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
}


@dataclass(frozen=True, kw_only=True)
class Damage:
    """A place where a record is not whole."""

    offset: int  # bytes from the beginning
    reason: str

    def __str__(self) -> str:
        """Return it in a line."""
        return f"byte {self.offset}: {self.reason}"


def is_finished(path: Path) -> bool:
    """Return whether a record has index and summary, that is, was closed.

    Raises:
        FileError: it cannot be read or is no MCAP file.
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
    """One pass over the records of a file, chunks opened.

    Args:
        path: the file.

    Attributes:
        damages: what was not whole, so far.
        finished: whether the end was reached and in order.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damages: list[Damage] = []
        self.finished = False
        self._left = 0  # bytes that chunks may still grow to

    def __iter__(self) -> Iterator[McapRecord]:
        """Yield headers, schemas, channels, messages, metadata and attachments, in file order.

        Raises:
            FileError: the file cannot be read or is no MCAP file.
        """
        self.damages, self.finished = [], False
        self._left = _allowance(self._path)
        with reading(self._path), self._path.open("rb") as stream:
            _check_magic(stream, self._path)
            yield from self._records(stream)
        if not self.finished and not self.damages:
            size = self._path.stat().st_size
            self.damages.append(Damage(offset=size, reason="ends without index and summary"))

    def _records(self, stream: IO[bytes]) -> Iterator[McapRecord]:
        known: set[int] = set()
        while (found := self._next(stream)) is not None:
            offset, kind, content = found
            if kind == Opcode.DATA_END:
                # What follows repeats what was read; a footer means that it was all written.
                self.finished = is_finished(self._path)
                return
            for record in self._parsed(offset, kind, content):
                if isinstance(record, Channel):
                    known.add(record.id)
                if isinstance(record, Message) and record.channel_id not in known:
                    self._note(offset, f"a message on unknown channel {record.channel_id}")
                    continue
                yield record

    def _next(self, stream: IO[bytes]) -> tuple[int, int, bytes] | None:
        """Return offset, kind and content of the next record; None at the end or a cut."""
        offset = stream.tell()
        head = stream.read(_HEAD_BYTES)
        if not head:
            return None
        length = int.from_bytes(head[1:], "little")
        fits = len(head) == _HEAD_BYTES and length <= self._path.stat().st_size - stream.tell()
        if not fits:
            self._note(offset, "the file is cut within a record")
            return None
        return offset, head[0], stream.read(length)

    def _parsed(self, offset: int, kind: int, content: bytes) -> list[McapRecord]:
        if kind == Opcode.MESSAGE:  # outside a chunk, which is optional
            read: Callable[[ReadDataStream], McapRecord] | None = partial(
                Message.read, length=len(content)
            )
        else:
            read = _READERS.get(kind)
        if read is None:
            return []  # indexes, and what a later MCAP may bring
        try:
            record = read(ReadDataStream(BytesIO(content)))
            if isinstance(record, Chunk):
                records = opened(record, min(self._left, _MAX_CHUNK_BYTES))
                self._left -= record.uncompressed_size
                return records
        except Exception as error:  # noqa: BLE001 - whatever a damaged record makes of parsers
            self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
            return []
        return [record]

    def _note(self, offset: int, reason: str) -> None:
        self.damages.append(Damage(offset=offset, reason=reason))


def opened(chunk: Chunk, max_bytes: int = _MAX_CHUNK_BYTES) -> list[McapRecord]:
    """Return a chunk's records.

    Args:
        chunk: as it stands in a file.
        max_bytes: what its records may have, opened.

    Raises:
        ValueError: it is larger, or not what it says to be; parsers raise more than that.
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
        stream: of the file.
        indices: of the chunks.

    Raises:
        ValueError: a chunk is not what it says to be; parsers raise more than that.
    """
    left = _allowance(Path(stream.name))
    for index in indices:
        stream.seek(index.chunk_start_offset + _HEAD_BYTES)
        chunk = Chunk.read(ReadDataStream(stream))
        yield opened(chunk, min(left, _MAX_CHUNK_BYTES))
        left -= chunk.uncompressed_size


def _allowance(path: Path) -> int:
    return _MAX_CHUNK_BYTES + _MAX_GROWTH * path.stat().st_size


def _check_magic(stream: IO[bytes], path: Path) -> None:
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise FileError(path, "is no flight record: expected an MCAP file (*.mcap)")
