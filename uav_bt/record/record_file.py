"""The file of a record: channels registered on first use, chunks closed by `flush`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from uav_bt import __version__
from uav_bt.files import writing
from uav_bt.plugins import need
from uav_bt.record.channels import Channel

_NS: Final = 1_000_000_000
_CHUNK_BYTES: Final = 4 * 1024 * 1024  # `flush` closes chunks; this bounds memory


class Attachment(NamedTuple):
    """A file attached to a record."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """Converts mission seconds to times on a record's timeline."""

    start_ns: int  # wall clock, since 1970
    start_s: float  # the mission clock at that moment

    def at(self, time_s: float) -> int:
        """Return the record's time of a mission time, nanoseconds since 1970."""
        return max(0, self.start_ns + round((time_s - self.start_s) * _NS))

    def since_start(self, time_ns: int) -> float:
        """Return the seconds from the record's start to one of its times."""
        return (time_ns - self.start_ns) / _NS


class RecordFile:
    """An MCAP file open for writing; an old record of that name is replaced."""

    def __init__(self, path: Path) -> None:
        need("record", "a flight record")
        from mcap.writer import Writer  # noqa: PLC0415 - an extra

        with writing(path):
            self._stream: IO[bytes] = path.open("wb")
        self._writer: Any = Writer(self._stream, chunk_size=_CHUNK_BYTES)
        self._channel_ids: dict[str, int] = {}
        self._schema_ids: dict[str, int] = {}
        self._writer.start(profile="", library=f"uav-bt/{__version__}")

    def write(self, channel: Channel, time_ns: int, data: bytes) -> None:
        """Add a message; OSError when the disk is full."""
        channel_id = self._channel_ids.get(channel.topic) or self._register(channel)
        self._writer.add_message(channel_id, log_time=time_ns, data=data, publish_time=time_ns)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._writer.flush()
        self._writer.add_metadata(name, dict(values))

    def attach(self, attachment: Attachment, time_ns: int) -> None:
        """Add a file."""
        self._writer.flush()
        self._writer.add_attachment(time_ns, time_ns, *attachment)

    def flush(self) -> None:
        """Close the chunk and hand everything to the system."""
        self._writer.flush()

    def finish(self) -> None:
        """Write index and summary, and close."""
        self._writer.finish()
        self._stream.close()

    def abandon(self) -> None:
        """Close without index and summary; data that the disk did not take is lost."""
        with suppress(OSError):  # closing flushes again, and the disk is still full
            self._stream.close()

    def _register(self, channel: Channel) -> int:
        encoding, schema_encoding, schema = channel.schema()
        name = channel.schema_name
        if name not in self._schema_ids:
            self._schema_ids[name] = self._writer.register_schema(name, schema_encoding, schema)
        channel_id: int = self._writer.register_channel(
            channel.topic, encoding, self._schema_ids[name]
        )
        self._channel_ids[channel.topic] = channel_id
        return channel_id
