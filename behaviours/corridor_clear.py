"""CorridorClear: is there room ahead? With it a tree file vetoes whoever chooses the way."""

from __future__ import annotations

from uav_bt.board import CORRIDOR, OBSTACLES
from uav_bt.tree import Leaf, Port, Status

__all__ = ["CorridorClear"]


class CorridorClear(Leaf):
    """SUCCESS while the safety corridor is free as far as told; FAILURE otherwise.

    A corridor that is not known, or known too long ago, is none to fly in.
    """

    condition = True
    ports = (
        Port("ahead_m", float, default=0.6, doc="room ahead of the body's centre, m"),
        Port("impact_s", float, default=0.8, doc="least time to impact at the present speed, s"),
        # Shorter than the rules' shortest step, narrower than their margins: where a rule finds the
        # way free this finds it free, too, and the two never take turns for ever.
        Port(
            "way_m", float, default=0.3, doc="way that must keep clear of remembered obstacles, m"
        ),
        Port("beside_m", float, default=0.4, doc="room to them along that way, m"),
    )
    reads = (CORRIDOR, OBSTACLES)

    def update(self) -> Status:
        """Look at what the corridor and the memory of obstacles leave."""
        self.feedback_message = self._objection()
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _objection(self) -> str:
        corridor, obstacles = self.read(CORRIDOR).value, self.read(OBSTACLES).value
        ahead_m = self.port_value("ahead_m")
        if corridor is None:
            return "corridor unknown"
        if corridor.free_distance_m < ahead_m:
            return f"{corridor.free_distance_m:.2f} m ahead"
        if corridor.time_to_impact_s < self.port_value("impact_s"):
            return f"impact in {corridor.time_to_impact_s:.1f} s"
        if obstacles is not None and not obstacles.allows(
            self.port_value("way_m"), margin_m=self.port_value("beside_m"), assumed=False
        ):
            return f"obstacle {obstacles.nearest_m:.2f} m away"
        return ""
