"""A short flight of the twin: its record and the ticks that a live follower saw."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from uav_bt import app
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.tree import Status

MISSION = """
<ReactiveSequence name="mission">
  <Segment model="unet"/>
  <FindMark/>
  <TrackMotion/>
  <MapSite/>
  <Sequence name="hop">
    <TakeOff height_m="1.0" gimbal_deg="-30"/>
    <Turn name="round" degrees="40"/>
    <Land/>
  </Sequence>
</ReactiveSequence>
"""


@dataclass
class Seen:
    """The ticks, boards and statuses that a live follower saw."""

    ticks: list[TickRecord] = field(default_factory=list)
    boards: list[dict[str, tuple[Any, float]]] = field(default_factory=list)
    statuses: list[dict[str, Status]] = field(default_factory=list)

    def follow(self, flight: app.Flight[Drone]) -> Sequence[TickListener]:
        seen, tree, context = self, flight.mission, flight.context

        class Follower:
            def on_tick(self, record: TickRecord) -> None:
                seen.ticks.append(record)
                seen.boards.append(copy.copy(context.board.snapshot()))
                seen.statuses.append({node.path: node.node_status for node in tree.nodes()})

        return [Follower()]


OPTIONS = app.FlightOptions(
    scene="val-a", seed=4, profile="ideal", image_size_px=(160, 90), exact_masks=True
)
