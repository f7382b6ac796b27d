"""Summary of a record: channels, rates, losses and damage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json
from uav_bt.record import channels
from uav_bt.record.channels import CHANNELS
from uav_bt.record.reader import RecordReader


@dataclass(frozen=True, kw_only=True)
class ChannelInfo:
    """One channel of a record."""

    topic: str
    content: str  # the schema's name
    messages: int
    rate_hz: float  # over the whole record
    bytes: int  # size of the messages before compression
    dropped: int  # messages omitted in flight


@dataclass(frozen=True, kw_only=True)
class RecordInfo:
    """Summary of a record."""

    path: str
    bytes: int
    finished: bool  # False: the flight was killed, or the disk was full
    start_s: float  # mission time of the first message
    duration_s: float
    ticks: int
    channels: tuple[ChannelInfo, ...]
    metadata: dict[str, str]
    end: dict[str, str] | None  # None if the flight did not close the record
    attachments: dict[str, int]  # bytes by name
    lost_ticks: int
    damages: tuple[str, ...]


def record_info(path: Path) -> RecordInfo:
    """Return the summary of a record; reads all of it to find every damage."""
    reader, start_ns, last_ns = RecordReader(path), None, 0
    counts: Counter[str] = Counter()
    sizes: Counter[str] = Counter()
    for message in reader.messages():
        counts[message.topic] += 1
        sizes[message.topic] += len(message.data)
        start_ns = message.time_ns if start_ns is None else min(start_ns, message.time_ns)
        last_ns = max(last_ns, message.time_ns)
    dropped, lost_ticks = _losses(path, reader.end or {})
    start_ns = reader.timeline.start_ns if start_ns is None else start_ns
    duration_s = max(0.0, (last_ns - start_ns) / 1e9)
    rows = tuple(
        ChannelInfo(
            topic=topic,
            content=CHANNELS[topic].schema_name if topic in CHANNELS else "",
            messages=counts[topic],
            rate_hz=round(counts[topic] / duration_s, 2) if duration_s > 0.0 else 0.0,
            bytes=sizes[topic],
            dropped=dropped.get(topic, 0),
        )
        for topic in sorted({*counts, *dropped})
    )
    return RecordInfo(
        path=str(path),
        bytes=path.stat().st_size,
        finished=reader.finished,
        start_s=reader.timeline.start_s + reader.timeline.since_start(start_ns),
        duration_s=duration_s,
        ticks=counts[channels.TICK.topic],
        channels=rows,
        metadata=reader.metadata,
        end=None if reader.end is None else dict(reader.end),
        attachments={name: len(item.data) for name, item in reader.attachments.items()},
        lost_ticks=lost_ticks,
        damages=reader.damages,
    )


def _losses(path: Path, end: Mapping[str, str]) -> tuple[dict[str, int], int]:
    """Return the number of omitted messages by topic, and of lost ticks."""
    try:
        dropped, lost_ticks = parse_json(end.get("dropped", "{}")), int(end.get("lost_ticks", "0"))
    except (InputError, ValueError) as error:
        raise FileError(path, f"the record's end is damaged: {error}") from error
    if not isinstance(dropped, dict) or not all(type(n) is int for n in dropped.values()):
        got = f"{end['dropped']:.80}"
        raise FileError(path, f"the record's end is damaged: expected numbers by topic, got {got}")
    return dropped, lost_ticks
