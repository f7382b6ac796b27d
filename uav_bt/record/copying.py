"""New records from old ones: what is whole of a damaged one, or a part of a long one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from uav_bt import __version__
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.record import channels
from uav_bt.record.channels import END, START
from uav_bt.record.reader import RecordReader

__all__ = ["CopyResult", "cut_record", "repair_record"]

_NS: Final = 1_000_000_000
_CHUNK_BYTES: Final = 4 * 1024 * 1024
# Said once at the beginning, or only when something changes: a part needs the last of each.
_STANDING: Final = frozenset(
    {channels.TREE.topic, channels.CALIBRATION.topic, channels.TREE_STATUS.topic}
)


@dataclass(frozen=True, kw_only=True)
class CopyResult:
    """What was written."""

    path: Path
    messages: int
    damages: tuple[str, ...]  # of the old record


def repair_record(path: Path, out: Path) -> CopyResult:
    """Write a whole record of all that is whole in another.

    Args:
        path: the unfinished or damaged record; it stays as it is.
        out: the new one; it appears when it is whole.

    Raises:
        FileError: the record cannot be read, or the new one not written.
    """
    reader = RecordReader(path)
    end = _old_end(reader)
    return _copy(reader, out, start=reader.metadata, end={**end, "repaired": "true"})


def cut_record(path: Path, out: Path, *, from_s: float, to_s: float) -> CopyResult:
    """Write a part of a record.

    Args:
        path: the record; it stays as it is.
        out: the new one; it appears when it is whole.
        from_s: seconds since the record's start.
        to_s: likewise; not included.

    Raises:
        FileError: the record cannot be read, the new one not written, or nothing lies within.
        ValueRangeError: the part ends before it begins.
    """
    if not 0.0 <= from_s < to_s:
        raise ValueRangeError(f"a cut needs 0 <= from < to, got {from_s} and {to_s} s")
    reader = RecordReader(path)
    before = float(reader.metadata.get("cut_from_s", "0"))
    start = {**reader.metadata, "cut_from_s": repr(before + from_s)}
    lower, upper = (reader.timeline.start_ns + round(s * _NS) for s in (from_s, to_s))
    # The part's own timeline begins where it does.
    start["start_ns"] = str(lower)
    start["start_s"] = repr(reader.timeline.start_s + from_s)
    return _copy(
        reader, out, start=start, end=_old_end(reader), within=lambda ns: lower <= ns < upper
    )


def _old_end(reader: RecordReader) -> dict[str, str]:
    return dict(reader.end or {"outcome": "unknown", "reason": "the record was not finished"})


def _copy(
    reader: RecordReader,
    out: Path,
    *,
    start: Mapping[str, str],
    end: Mapping[str, str],
    within: Callable[[int], bool] | None = None,
) -> CopyResult:
    if out.resolve() == reader.path.resolve():
        raise FileError(out, "is the record itself; write to another file")
    partial = out.with_name(f"{out.name}.part")
    try:
        with partial.open("wb") as stream:
            count = _write(reader, stream, start, end, within)
        if within is not None and count == 0:
            partial.unlink()
            raise FileError(reader.path, "has no tick within that part")
        partial.replace(out)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise FileError(out, f"cannot be written: {error.strerror}") from error
    return CopyResult(path=out, messages=count, damages=reader.damages)


def _write(
    reader: RecordReader,
    stream: Any,
    start: Mapping[str, str],
    end: Mapping[str, str],
    within: Callable[[int], bool] | None,
) -> int:
    from mcap.writer import Writer  # noqa: PLC0415 - an extra

    writer: Any = Writer(stream, chunk_size=_CHUNK_BYTES)
    writer.start(profile="", library=f"uav-bt/{__version__}")
    writer.add_metadata(START, dict(start))
    start_ns = int(start["start_ns"])
    for attachment in reader.attachments.values():
        writer.add_attachment(
            create_time=start_ns,
            log_time=start_ns,
            name=attachment.name,
            media_type=attachment.media_type,
            data=attachment.data,
        )
    copier = _Copier(writer, start_ns)
    for schema, channel, message in reader.raw_messages():
        if within is None or within(message.log_time):
            copier.add(schema, channel, message)
        elif message.log_time < start_ns and channel.topic in _STANDING:
            copier.hold(schema, channel, message)
    writer.add_metadata(END, dict(end))
    writer.finish()
    return copier.count


class _Copier:
    """Adds messages under ids of the new file; those held come first, dated to its start."""

    def __init__(self, writer: Any, start_ns: int) -> None:
        self._writer = writer
        self._start_ns = start_ns
        self._held: dict[str, tuple[Any, Any, Any]] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self.count = 0  # of messages that were not only held

    def hold(self, schema: Any, channel: Any, message: Any) -> None:
        """Keep a message in case that the part begins after it."""
        self._held[channel.topic] = (schema, channel, message)

    def add(self, schema: Any, channel: Any, message: Any) -> None:
        """Add a message."""
        held, self._held = self._held, {}
        for old_schema, old_channel, old in held.values():
            self._put(old_schema, old_channel, old, self._start_ns)
        self._put(schema, channel, message, message.log_time)
        self.count += 1

    def _put(self, schema: Any, channel: Any, message: Any, time_ns: int) -> None:
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        if channel.topic not in self._channels:
            self._channels[channel.topic] = self._writer.register_channel(
                channel.topic, channel.message_encoding, self._schemas[schema.name]
            )
        self._writer.add_message(
            self._channels[channel.topic],
            log_time=time_ns,
            data=message.data,
            publish_time=time_ns,
            sequence=message.sequence,
        )
