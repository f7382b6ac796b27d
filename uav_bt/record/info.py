"""Summary of a record: channels, rates, losses and damage."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from uav_bt.files import parse_json
from uav_bt.record import channels
from uav_bt.record.channels import CHANNELS
from uav_bt.record.reader import RecordReader


def record_info(path: Path) -> dict[str, Any]:
    """Return the summary of a record; reads all of it to find every damage.

    `finished` is False if the flight was killed or the disk was full; `end` is None then. Of a
    channel, `rate_hz` counts over the whole record, `bytes` before compression, and `dropped` are
    messages omitted in flight.
    """
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
    rows = [
        {
            "topic": topic,
            "content": CHANNELS[topic].schema_name if topic in CHANNELS else "",
            "messages": counts[topic],
            "rate_hz": round(counts[topic] / duration_s, 2) if duration_s > 0.0 else 0.0,
            "bytes": sizes[topic],
            "dropped": dropped.get(topic, 0),
        }
        for topic in sorted({*counts, *dropped})
    ]
    return {
        "path": str(path),
        "bytes": path.stat().st_size,
        "finished": reader.finished,
        "start_s": reader.timeline.start_s + reader.timeline.since_start(start_ns),
        "duration_s": duration_s,
        "ticks": counts[channels.TICK.topic],
        "channels": rows,
        "metadata": reader.metadata,
        "end": reader.end,
        "attachments": {name: len(item.data) for name, item in reader.attachments.items()},
        "lost_ticks": lost_ticks,
        "damages": reader.damages,
    }
