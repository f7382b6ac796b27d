"""Helpers of the tests of records: a drone with noise images, and its short flights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

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

    Returns:
        The path of the written file.
    """
    topics: dict[int, str] = {}
    timeline = RecordReader(path).timeline
    ids: dict[tuple[type, int], int] = {}
    with out.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for found in RecordScan(path):
            if isinstance(found, Metadata):
                more = (metadata or {}).get(found.name, {})
                writer.add_metadata(found.name, {**found.metadata, **more})
            elif isinstance(found, Attachment):
                writer.add_attachment(
                    found.create_time, found.log_time, found.name, found.media_type, found.data
                )
            elif isinstance(found, Schema):
                ids[Schema, found.id] = writer.register_schema(
                    found.name, found.encoding, found.data
                )
            elif isinstance(found, Channel):
                topics[found.id] = found.topic
                ids[Channel, found.id] = writer.register_channel(
                    found.topic, found.message_encoding, ids[Schema, found.schema_id]
                )
            elif (
                isinstance(found, Message)
                and from_s <= timeline.since_start(found.log_time) < to_s
                and topics[found.channel_id] != without
            ):
                writer.add_message(
                    ids[Channel, found.channel_id],
                    log_time=found.log_time,
                    data=(messages or {}).get(topics[found.channel_id], found.data),
                    publish_time=found.publish_time,
                )
        writer.finish()
    return out
