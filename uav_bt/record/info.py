"""Summary of a record: channels, rates, losses and damage."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

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
    reader = RecordReader(path)
    counts: Counter[str] = Counter()
    sizes: Counter[str] = Counter()
    times_ns: list[int] = []
    for topic, time_ns, data in reader.messages():
        counts[topic] += 1
        sizes[topic] += len(data)
        times_ns.append(time_ns)
    end = reader.end or {}
    with reader.intact("the end"):
        lost_ticks = int(end.get("lost_ticks", "0"))
        left_out = parse_json(end.get("dropped", "{}"))
        dropped = {topic: int(count) for topic, count in left_out.items()}
    start_ns = min(times_ns, default=reader.timeline.start_ns)
    duration_s = (max(times_ns, default=start_ns) - start_ns) / 1e9
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
