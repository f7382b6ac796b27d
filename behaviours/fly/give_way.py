"""GiveWay: the leaf that comes first where things move."""

from __future__ import annotations

import math

from behaviours.fly.course_leaf import GIMBAL, CourseLeaf
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState


class GiveWay(CourseLeaf):
    """Stop for what moves, and get out of its way; FAILURE when nothing comes too near.

    As the first child of a `ReactiveFallback` it interrupts the others.
    """

    ports = (
        Port(
            "gives_way", bool, default=True, doc="whether it gives way; where not, it always fails"
        ),
        GIMBAL,
    )

    def update(self) -> Status:
        """Give way where the port says so; without telemetry the others decide."""
        return super().update() if self.state() is not None else Status.FAILURE

    def work(self, state: DroneState) -> Status:
        """Give way."""
        del state
        gives_way = self.port_value("gives_way") and self.give_way()
        return Status.RUNNING if gives_way else Status.FAILURE

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight: what moves is to stay in view."""
        return math.radians(self.port_value("gimbal_deg"))
