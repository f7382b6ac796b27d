"""MoveBy: one straight movement."""

from __future__ import annotations

import math
from typing import Final

from behaviours.fly.moving_leaf import Progress
from behaviours.fly.places import PlaceLeaf
from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.ports import number
from uav_bt.board import PHASE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Status
from uav_bt.types import DroneState, MissionPhase
from uav_bt.types.site_map import SiteMap

_NEAR_M: Final = 0.02  # a movement along the ground that is shorter needs no map; chosen


class MoveBy(PlaceLeaf):
    """Move in a straight line without turning; SUCCESS at its end.

    FAILURE when the map does not show the line free, at the beginning or later, and after repeated
    attempts without progress. A movement straight up or down needs no map. An override interrupts
    the movement, and it goes on afterwards.
    """

    repeats = True
    ports = (
        number("forward_m", 0.0, -5, 5, "distance ahead, m"),
        number("right_m", 0.0, -5, 5, "distance to the right, m"),
        number("up_m", 0.0, -5, 5, "distance upwards, m"),
    )
    resumes = True

    def on_setup(self, mission: MissionContext) -> None:
        """Note the margins of the place."""
        super().on_setup(mission)
        self._margins = Margins().within(mission.clearances).tight()

    def initialise(self) -> None:
        """Begin with the movement."""
        super().initialise()
        self.write(PHASE, MissionPhase.GO_TO)
        self._to: tuple[float, float] | None = None  # x and y of its end on the map, m
        self._begun = False
        self._checked_s = -math.inf  # capture time of the map on which the line was checked

    def work(self, state: DroneState) -> Status:
        """Move while the line is free."""
        forward_m, right_m = self.port_value("forward_m"), self.port_value("right_m")
        if math.hypot(forward_m, right_m) > _NEAR_M:
            site_map = self.trusted_map()
            if site_map is None:
                return self.fails("no map shows whether the way is free")
            self._to = self._to or site_map.pose.to_world(forward_m, right_m)
            if not self._is_free(site_map, self._to):
                return self.fails("the map does not show the way free")
        if not self._begun:
            self._begun = True
            down_m = -self.port_value("up_m")
            self.start_move(forward_m=forward_m, right_m=right_m, down_m=down_m)
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.DONE:
            return Status.SUCCESS
        return self.fails(self.trouble or "a person has flown the drone")

    def _is_free(self, site_map: SiteMap, to: tuple[float, float]) -> bool:
        if site_map.captured_s == self._checked_s:
            return True
        self._checked_s = site_map.captured_s
        recent = recent_obstacles(self.obstacles(), site_map)
        return ClearanceMap(site_map, recent, self._margins).is_open_to(*to)


NODES = (MoveBy,)
