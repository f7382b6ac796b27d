"""The plots: heading error, height, free distance, tick time. What is not known leaves a gap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import rerun as rr

from uav_bt.display.canvas import ACCENT, ALARM, INK, Colour
from uav_bt.display.rerun.entities import FREE_DISTANCE, HEADING, HEIGHT, TICK_TIME
from uav_bt.mission.runner import TickRecord
from uav_bt.types import Corridor, HelipadFix, MoveBy, ObstaclePoints, wrap_angle

_BLUE: Final[Colour] = (94, 205, 255)


@dataclass(frozen=True, kw_only=True)
class _Series:
    name: str
    colour: Colour


_SERIES: Final = {
    f"{HEADING}/turn": _Series(name="of the turn", colour=ACCENT),
    f"{HEADING}/helipad": _Series(name="to the helipad", colour=_BLUE),
    f"{HEIGHT}/telemetry": _Series(name="telemetry", colour=ACCENT),
    f"{HEIGHT}/true": _Series(name="true", colour=_BLUE),
    f"{FREE_DISTANCE}/ahead": _Series(name="ahead", colour=ACCENT),
    f"{FREE_DISTANCE}/intrusion": _Series(name="intrusion", colour=ALARM),
    f"{FREE_DISTANCE}/remembered": _Series(name="remembered", colour=_BLUE),
    f"{FREE_DISTANCE}/clearance": _Series(name="true clearance", colour=INK),
    f"{TICK_TIME}/compute": _Series(name="tree and networks", colour=ACCENT),
}


class TurnLeft:
    """How much of the turn of a `MoveBy` is left: its heading error."""

    def __init__(self) -> None:
        self._id: int | None = None
        self._target_rad = 0.0

    def after(self, record: TickRecord) -> float | None:
        """Return the heading still to turn, clockwise positive; None when no turn goes on."""
        movement, yaw_rad = record.command.movement, record.observation.state.attitude.yaw_rad
        if not isinstance(movement, MoveBy) or movement.yaw_rad == 0.0:
            self._id = None
            return None
        if movement.id != self._id:
            self._id = movement.id
            self._target_rad = yaw_rad + movement.yaw_rad
        return wrap_angle(self._target_rad - yaw_rad)


class FlightPlots:
    """Draws a point of every series in every tick.

    Args:
        stream: where to.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._turn = TurnLeft()
        for entity, series in _SERIES.items():
            line = rr.SeriesLines(names=[series.name], colors=[series.colour], widths=[1.5])
            stream.log(entity, line, static=True)

    def show(
        self,
        record: TickRecord,
        *,
        corridor: Corridor | None,
        obstacles: ObstaclePoints | None,
        fix: HelipadFix | None,
    ) -> None:
        """Draw a tick."""
        turn_rad, truth = self._turn.after(record), record.truth
        free_m = None if corridor is None else corridor.free_distance_m
        intrusion_m = None if corridor is None else corridor.nearest_m
        remembered_m = None if obstacles is None else obstacles.nearest_m
        clearance_m = None if truth is None else truth.clearance_m
        height_m = record.observation.state.height_above_carpet_m
        self._point(f"{HEADING}/turn", None if turn_rad is None else math.degrees(turn_rad))
        self._point(f"{HEADING}/helipad", None if fix is None else math.degrees(fix.bearing_rad))
        self._point(f"{HEIGHT}/telemetry", height_m)
        self._point(f"{HEIGHT}/true", None if truth is None else truth.pose.z_m)
        self._point(f"{FREE_DISTANCE}/ahead", free_m)
        self._point(f"{FREE_DISTANCE}/intrusion", intrusion_m)
        self._point(f"{FREE_DISTANCE}/remembered", remembered_m)
        self._point(f"{FREE_DISTANCE}/clearance", clearance_m)
        self._point(f"{TICK_TIME}/compute", 1000.0 * record.compute_s)

    def _point(self, entity: str, value: float | None) -> None:
        shown = value if value is not None and math.isfinite(value) else math.nan
        self._stream.log(entity, rr.Scalars(shown))
