"""GiveWay: stop for movers and get out of their way, ahead of the other leaves."""

from __future__ import annotations

import math

from behaviours.fly.course_leaf import GIMBAL, CourseLeaf
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState


class GiveWay(CourseLeaf):
    """Stop for a mover, and get out of its way; FAILURE when none comes too near.

    As the first child of a `ReactiveFallback` it interrupts the others.
    """

    points = True
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (
        Port(
            "gives_way", bool, default=True, doc="whether it gives way; where not, it always fails"
        ),
        GIMBAL,
    )

    def update(self) -> Status:
        """Give way if the port is set; without telemetry FAILURE."""
        return super().update() if self.state() is not None else Status.FAILURE

    def work(self, state: DroneState) -> Status:
        """Give way."""
        del state
        gives_way = self.port_value("gives_way") and self.give_way()
        return Status.RUNNING if gives_way else Status.FAILURE

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight, or lower to show the base of a mover."""
        return self.ground_pitch_rad(math.radians(self.port_value("gimbal_deg")))
