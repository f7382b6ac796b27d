"""Face: turn to a place or a heading."""

from __future__ import annotations

import math

from behaviours.fly.place_leaf import PlaceLeaf
from behaviours.fly.steering import GIVES_WAY
from uav_bt.answers import Rotate
from uav_bt.board import PHASE
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MissionPhase, wrap_angle
from uav_bt.types.place import Place
from uav_bt.types.place_frames import Unresolved
from uav_bt.types.site_map import SiteMap


def _facing(text: str) -> float | Place:
    """Return the heading, radians, or the place of a text.

    Raises:
        ValueRangeError: The text is neither.
    """
    try:
        degrees = float(text)
    except ValueError:
        return Place.parse(text)
    return math.radians(math.remainder(degrees, 360.0)) if math.isfinite(degrees) else 0.0


class Face(PlaceLeaf):
    """Turn on the spot to a place or a heading; SUCCESS when the drone faces it and stands still.

    FAILURE for a place that cannot be found, and when the drone does not face it in time.
    """

    place_port = Port(
        "at",
        str,
        doc="place, or heading in degrees, clockwise from the take-off heading",
        check=_facing,
        sample="mark",
    )
    ports = (
        place_port,
        Port("give_up_s", float, default=15.0, least=0, most=3600, doc="time until it fails, s"),
        GIVES_WAY,
    )

    def initialise(self) -> None:
        """Begin the turn."""
        super().initialise()
        self.write(PHASE, MissionPhase.LOOK)
        self._faced_s = self.leaf_clock.now()  # it has been faced since

    def work(self, state: DroneState) -> Status:
        """Turn until the place is ahead."""
        if self.leaf_clock.now() - self._progress_s > self.port_value("give_up_s"):
            return self.fails("does not face it in time")
        if self.gives_way():
            self._faced_s = self.leaf_clock.now()
            return Status.RUNNING
        site_map = self.trusted_map()
        if site_map is None:
            self.feedback_message = "no map, or the views contradict it"
            return Status.RUNNING
        turn_rad = self._turn_rad(site_map)
        if isinstance(turn_rad, Unresolved):
            return self.fails(turn_rad.reason)
        self.feedback_message = f"{math.degrees(turn_rad):.0f} deg left"
        now_s = self.leaf_clock.now()
        if abs(turn_rad) > self.config.facing_rad:
            self._faced_s = now_s
        if now_s - self._faced_s >= self.config.faced_s:
            return Status.SUCCESS
        self.fly_on(state, Rotate(yaw_rad=turn_rad, reason="faces"))
        return Status.RUNNING

    def _turn_rad(self, site_map: SiteMap) -> float | Unresolved:
        """Return the turn that is left."""
        text = self.port_value("at")
        facing = _facing(text)
        if isinstance(facing, float):
            return wrap_angle(site_map.start.yaw_rad + facing - site_map.pose.yaw_rad)
        found = self.goal(site_map, text)
        if isinstance(found, Unresolved):
            return found
        forward_m, right_m = site_map.pose.to_body(found.x_m, found.y_m)
        return math.atan2(right_m, forward_m)
