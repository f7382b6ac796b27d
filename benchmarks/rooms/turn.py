"""A flight that turns once around in a room, and its footage."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from perception.odometry.flown_footage import FootageBuilder
from uav_bt import app
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone

TREE: Final = Path(__file__).parents[1] / "missions" / "sway_around.xml"
FOOTAGE_PX: Final = (448, 224)


class Gatherer:
    """Gathers the footage of the turn."""

    def __init__(self) -> None:
        self.builder: FootageBuilder | None = None

    def follow(self, flight: app.Flight[Drone]) -> Sequence[Gatherer]:
        """Become a listener of a flight."""
        self.builder = FootageBuilder(flight.drone.camera, FOOTAGE_PX)
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Keep telemetry, and the frames of the turn."""
        if self.builder is None:
            return
        self.builder.add_state(record.observation.state)
        frame = record.observation.frame
        if frame is not None and any("SwayAround" in name for name in record.active):
            self.builder.add_frame(frame)


def fly_around(lab: str, scene: str, seed: int) -> Gatherer:
    """Fly the turn in a scene of a lab."""
    gathered = Gatherer()
    options = app.FlightOptions(lab=lab, scene=scene, seed=seed)
    app.fly(str(TREE), options, listeners=[gathered.follow])
    return gathered
