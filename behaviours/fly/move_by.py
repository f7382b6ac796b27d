"""MoveBy and ClimbTo: one straight movement, and another flight height."""

from __future__ import annotations

import math

from behaviours.fly.moving_leaf import MovingLeaf
from behaviours.fly.places import PlaceLeaf
from behaviours.fly.step import Progress
from behaviours.fly.take_off import above_ceiling
from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from uav_bt.board import FLIGHT_HEIGHT, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MissionPhase
from uav_bt.types.place_frames import Goal
from uav_bt.types.site_map import SiteMap

_NEAR_M = 0.02  # m; a movement along the ground that is shorter needs no map; chosen


def _distance(name: str, doc: str) -> Port[float]:
    return Port(name, float, default=0.0, least=-5, most=5, doc=doc)


class MoveBy(PlaceLeaf):
    """Move in a straight line without turning; SUCCESS at its end.

    FAILURE when the map does not show the line free, at the beginning or later, and after repeated
    attempts without progress. A movement straight up or down needs no map. An override interrupts
    the movement, and it goes on afterwards.
    """

    repeats = True
    ports = (
        _distance("forward_m", "distance ahead, m"),
        _distance("right_m", "distance to the right, m"),
        _distance("up_m", "distance upwards, m"),
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
        self._goal: Goal | None = None
        self._begun = False
        self._checked_s = -math.inf  # capture time of the map on which the line was checked

    def work(self, state: DroneState) -> Status:
        """Move while the line is free."""
        forward_m, right_m = self.port_value("forward_m"), self.port_value("right_m")
        if math.hypot(forward_m, right_m) > _NEAR_M:
            site_map = self.trusted_map()
            if site_map is None:
                return self.fails("no map shows whether the way is free")
            if self._goal is None:
                x_m, y_m = site_map.pose.to_world(forward_m, right_m)
                self._goal = Goal(x_m=x_m, y_m=y_m)
            if not self._is_free(site_map, self._goal):
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

    def _is_free(self, site_map: SiteMap, goal: Goal) -> bool:
        if site_map.captured_s == self._checked_s:
            return True
        self._checked_s = site_map.captured_s
        recent = recent_obstacles(self.obstacles(), site_map)
        return ClearanceMap(site_map, recent, self._margins).is_open_to(goal.x_m, goal.y_m)


class ClimbTo(MovingLeaf):
    """Climb or sink to another flight height; SUCCESS there.

    The leaves after it keep that height. FAILURE after repeated attempts without progress.
    """

    repeats = True
    ports = (
        Port(
            "height_m",
            float,
            least=0.3,
            most=20,
            doc="flight height above the ground, m",
            caution=above_ceiling,
        ),
    )
    reads = (STATE,)
    writes = (PHASE, FLIGHT_HEIGHT)
    slack_m = 0.1  # as of the take-off

    def initialise(self) -> None:
        """Write the mission's flight height."""
        self.write(PHASE, MissionPhase.GO_TO)
        self.write(FLIGHT_HEIGHT, self.port_value("height_m"))

    def work(self, state: DroneState) -> Status:
        """Climb or sink until the height is reached."""
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.FAILED:
            self.feedback_message = self.trouble
            return Status.FAILURE
        too_high_m = state.height_above_ground_m - self.port_value("height_m")
        if abs(too_high_m) <= self.slack_m:
            return Status.SUCCESS
        self.start_move(down_m=too_high_m)
        return Status.RUNNING
