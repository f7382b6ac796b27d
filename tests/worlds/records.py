"""Helpers of the tests of records: a drone with noise images, and its short flights."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import Writer

from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.mission.flight_report import FlightReport
from uav_bt.protocols import Drone
from uav_bt.record.reader import RecordReader
from uav_bt.record.scan import RecordScan
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Observation

FLIGHT = """
<Sequence>
  <TakeOff height_m="1.5"/>
  <Turn name="away" degrees="90"/>
  <HoverFor seconds="0.5"/>
  <Turn name="back" degrees="-90"/>
  <Land/>
</Sequence>
"""


class NoisyDrone(ScriptedDrone):
    """A scripted drone whose frames are different noise images."""

    def observe(self) -> Observation:
        """Return the scripted observation with a noisy image."""
        seen = super().observe()
        if seen.frame is None:
            return seen
        image = np.random.default_rng(seen.frame.index).integers(
            100, 140, seen.frame.image.shape, dtype=np.uint8
        )
        return replace(seen, frame=replace(seen.frame, image=image))


ANYWHERE = app.JudgeConfig(land_on=app.LandOn.ANY)  # nobody looks for a mark


def fly_noisy(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    body: str = FLIGHT,
    drone: Drone | None = None,
    options: app.FlightOptions | None = None,
    out: Path | None = None,
) -> tuple[Path, FlightReport]:
    """Fly a mission with a scripted drone and return its record."""
    flown = drone or NoisyDrone()
    monkeypatch.setattr("uav_bt.app.assembly.make_drone", lambda _: flown)
    record = folder / "flight.mcap"
    options = replace(options or app.FlightOptions(seed=5), record=record, judge=ANYWHERE)
    return record, app.fly(tree_file(folder, body), options, out=out)


def copy_part(
    path: Path,
    out: Path,
    *,
    from_s: float = 0.0,
    to_s: float = math.inf,
    metadata: Mapping[str, Mapping[str, str]] | None = None,
    messages: Mapping[str, bytes] | None = None,
    without: str | None = None,
    order: Callable[[tuple[str, Message]], Any] | None = None,
    extras_last: bool = False,
    chunks: bool = True,
) -> Path:
    """Copy the intact content of a record, or a part, as `mcap recover` and `mcap filter` do.

    Args:
        path: the record.
        out: the file to write.
        from_s: start of the part, s since the record's start.
        to_s: end of the part, s since the record's start.
        metadata: entries that replace the record's, by the metadata's name.
        messages: new contents of all messages, by topic.
        without: topic to leave out.
        order: key by which topics and messages are sorted.
        extras_last: whether metadata and attachments stand behind the messages.
        chunks: whether messages stand in chunks.

    Returns:
        The path of the written file.
    """
    timeline = RecordReader(path).timeline
    whole = list(RecordScan(path))
    schemas, ids = {0: 0}, dict[int, int]()
    with out.open("wb") as stream:
        writer = Writer(stream, chunk_size=20_000, use_chunking=chunks)
        writer.start()
        for _, each in whole:
            if isinstance(each, Schema):
                schemas[each.id] = writer.register_schema(each.name, each.encoding, each.data)
            elif isinstance(each, Channel):
                ids[each.id] = writer.register_channel(
                    each.topic, each.message_encoding, schemas[each.schema_id]
                )
        if not extras_last:
            write_extras(writer, whole, metadata or {})
        found = [(topic, each) for topic, each in whole if topic is not None and topic != without]
        for topic, each in sorted(found, key=order or (lambda _: 0)):
            if from_s <= timeline.since_start(each.log_time) < to_s:
                data = (messages or {}).get(topic, each.data)
                writer.add_message(ids[each.channel_id], each.log_time, data, each.publish_time)
        if extras_last:
            write_extras(writer, whole, metadata or {})
        writer.finish()
    return out


def write_extras(
    writer: Writer, whole: list[tuple[str | None, Any]], metadata: Mapping[str, Mapping[str, str]]
) -> None:
    for _, each in whole:
        if isinstance(each, Metadata):
            writer.add_metadata(each.name, {**each.metadata, **metadata.get(each.name, {})})
        elif isinstance(each, Attachment):
            writer.add_attachment(
                each.create_time, each.log_time, each.name, each.media_type, each.data
            )
