"""Reading a record from its beginning, past damaged chunks, to the place where it was cut."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, Final

from lz4.frame import LZ4FrameDecompressor
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, DataEnd, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdDecompressor

from uav_bt.errors import FileError
from uav_bt.files import reading

_MAGIC: Final = bytes((0x89, 0x4D, 0x43, 0x41, 0x50, 0x30, 0x0D, 0x0A))
_FOOTER_BYTES: Final = 29  # opcode, length and content, by the MCAP specification
# Our chunks have 4 MiB and the rest of a burst; chosen eight times as large.
_MAX_CHUNK_BYTES: Final = 32 * 1024 * 1024


class RecordScan:
    """Passes over the records of an MCAP file, with its chunks opened.

    Attributes:
        finished: whether the record was closed, and so has index and summary.
        damages: the damaged places that the last pass has met, one line each.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.damages: list[str] = []
        with reading(path), path.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise FileError(path, "is not a flight record: expected an MCAP file (*.mcap)")
            self._size_bytes = stream.seek(0, 2)
            stream.seek(max(self._size_bytes - len(_MAGIC) - _FOOTER_BYTES, len(_MAGIC)))
            tail = stream.read()
        self.finished = tail.endswith(_MAGIC) and tail[0] == Opcode.FOOTER

    def __iter__(self) -> Iterator[tuple[str | None, Any]]:
        """Yield the records in the order of the file, messages with their topics.

        A damaged chunk is skipped. A record that cannot be read is the end of a cut file.
        """
        self.damages = []
        topics: dict[int, str] = {}
        with reading(self._path), self._path.open("rb") as stream:
            for offset, record in self._stored(stream):
                inside = [record]
                if isinstance(record, Chunk):
                    try:
                        inside = opened(record)
                    except Exception as error:  # noqa: BLE001 - a damaged chunk raises anything
                        self._note(offset, f"a damaged record ({type(error).__name__}: {error})")
                        continue
                for one in inside:
                    if isinstance(one, Channel):
                        topics[one.id] = one.topic
                    if not isinstance(one, Message):
                        yield None, one
                    elif one.channel_id in topics:
                        yield topics[one.channel_id], one
                    else:
                        self._note(offset, f"a message on unknown channel {one.channel_id}")
        if not self.damages and not self.finished:
            self._note(self._size_bytes, "ends without index and summary")

    def _stored(self, stream: IO[bytes]) -> Iterator[tuple[int, McapRecord]]:
        """Yield the records before the index with their offsets."""
        stream.seek(len(_MAGIC))
        # Each length is checked against the limit before the record is read.
        records = StreamReader(
            stream, skip_magic=True, emit_chunks=True, record_size_limit=self._size_bytes
        ).records
        while (offset := stream.tell()) < self._size_bytes:
            try:
                record = next(records, None)
            except Exception as error:  # noqa: BLE001 - a damaged record raises anything
                what = f"a damaged record ({type(error).__name__}: {error})"
                cut = stream.tell() >= self._size_bytes
                self._note(offset, "the file is cut within a record" if cut else what)
                return
            if record is None or isinstance(record, DataEnd):  # the rest repeats what was read
                return
            yield offset, record

    def _note(self, offset: int, reason: str) -> None:
        self.damages.append(f"byte {offset}: {reason}")

    def indexed(self) -> list[Metadata | Attachment]:
        """Return metadata and attachments, which may stand behind the messages."""
        with self._path.open("rb") as stream:
            try:
                reader = SeekingReader(stream, validate_crcs=True)
                return [*reader.iter_metadata(), *reader.iter_attachments()]
            except Exception:  # noqa: BLE001 - a damaged index raises anything
                return []


def opened(chunk: Chunk) -> list[McapRecord]:
    """Return a chunk's records; ValueError if it is too large or not of the size that it says."""
    size = chunk.uncompressed_size
    if size > _MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes, opened, more than {_MAX_CHUNK_BYTES}")
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
