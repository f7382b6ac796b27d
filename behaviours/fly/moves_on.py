"""MovesOn: does the drone still get away from its place? With it a tree gives up in time."""

from __future__ import annotations

import math

from behaviours.fly.leaf_clock import LeafClock
from uav_bt.board import ODOMETRY
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import Pose2D


class MovesOn(Leaf):
    """SUCCESS while the drone moves on; FAILURE when it has stayed around one place for too long.

    Time in which the leaf is not ticked does not count. The place and the time are kept when the
    tree tries again, so that attempts at one place do not add up. Without odometry the answer is
    SUCCESS.
    """

    condition = True
    ports = (
        Port(
            "within_m",
            float,
            default=0.5,
            least=0.1,
            most=100,
            doc="a drone within this distance of a place stays there, m",
        ),
        # Chosen: one look for a way (15 s), a full turn of a detour (11 s) and one of a scan below
        # (8 s) take 34 s. A drone that could go on has done so after them.
        Port("for_s", float, default=60.0, least=1, most=3600, doc="longest stay, s"),
    )
    reads = (ODOMETRY,)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a place."""
        self._clock = LeafClock(mission.clock)
        self._place: Pose2D | None = None
        self._since_s = 0.0  # leaf's time

    def update(self) -> Status:
        """Compare the time since the drone came to its place with the longest stay."""
        self._clock.tick()
        motion, now_s = self.read(ODOMETRY).value, self._clock.now()
        if motion is None:
            return Status.SUCCESS
        here, place = motion.pose, self._place
        moved = place is None or math.hypot(here.x_m - place.x_m, here.y_m - place.y_m) > (
            self.port_value("within_m")
        )
        if moved:
            self._place, self._since_s = here, now_s
        stayed_s = now_s - self._since_s
        self.feedback_message = f"{stayed_s:.0f} s at one place"
        return Status.SUCCESS if stayed_s < self.port_value("for_s") else Status.FAILURE
