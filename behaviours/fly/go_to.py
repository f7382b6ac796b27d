"""GoTo: fly to a place by the map."""

from __future__ import annotations

import math

from behaviours.fly.place_leaf import PlaceLeaf
from behaviours.fly.steering import GIVES_WAY
from behaviours.path.margins import Margins
from behaviours.path.to_place import StepTo, WayTo, way_to
from uav_bt.answers import Rotate
from uav_bt.board import CORRIDOR, FLIGHT_HEIGHT, PHASE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MissionPhase, wrap_angle
from uav_bt.types.place import Place
from uav_bt.types.place_frames import Goal, Unresolved
from uav_bt.types.site_map import SiteMap


class GoTo(PlaceLeaf):
    """Fly to a place over ground that the map shows free; SUCCESS there, standing still.

    The way keeps its distance from obstacles and edges to its end. Where no way is known the drone
    looks around, and FAILURE comes after `blocked_s` without progress. FAILURE comes at once for a
    place that cannot be found, such as an object that is not on the map.
    An override or a pilot interrupts the flight, and it goes on afterwards.
    """

    place_port = Port(
        "to", str, doc="place, such as start:2,0 or mark", check=Place.parse, sample="start:2,0"
    )
    ports = (
        place_port,
        Port(
            "arrive_m",
            float,
            default=0.15,
            least=0.05,
            most=2,
            doc="distance from the place that counts as there, m",
        ),
        Port("speed_mps", float, default=0.6, least=0.1, most=2, doc="highest speed, m/s"),
        Port(
            "blocked_s",
            float,
            default=10.0,
            least=0,
            most=3600,
            doc="time without progress until it fails, s",
        ),
        GIVES_WAY,
    )
    reads = (*PlaceLeaf.reads, CORRIDOR)
    writes = (*PlaceLeaf.writes, FLIGHT_HEIGHT)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the margins of the place."""
        super().on_setup(mission)
        self._margins = Margins().within(mission.clearances)

    def initialise(self) -> None:
        """Plan afresh."""
        super().initialise()
        self.write(PHASE, MissionPhase.GO_TO)
        self._planned_s = self._best_m = math.inf
        self._steps = 0
        self._below = False  # whether the drone looks at ground below the view in flight
        self._trouble = "no map yet"

    def work(self, state: DroneState) -> Status:
        """Plan on each new map; follow the last plan in between."""
        # Ahead of all proposals: a leaf that ends proposes nothing.
        if self.leaf_clock.now() - self._progress_s > self.port_value("blocked_s"):
            return self.fails(self._trouble)
        if self.gives_way():
            self._planned_s = math.inf
            return Status.RUNNING
        if self.moving(state):
            return Status.RUNNING
        site_map = self.trusted_map()
        if site_map is None:
            self._trouble = "no map, or the views contradict it"
            return Status.RUNNING
        found = self.goal(site_map, self.port_value("to"))
        if isinstance(found, Unresolved):
            return self.fails(found.reason)
        return self._towards(found, state, site_map)

    def _towards(self, goal: Goal, state: DroneState, site_map: SiteMap) -> Status:
        if goal.height_m is not None:
            self.write(FLIGHT_HEIGHT, goal.height_m)
        apart_m = math.dist((goal.x_m, goal.y_m), (site_map.pose.x_m, site_map.pose.y_m))
        centred = self._steps >= self.config.steps or apart_m < self.port_value("arrive_m") / 2
        if apart_m <= self.port_value("arrive_m") and centred:
            return self._arrived(state, site_map, goal)
        if site_map.captured_s == self._planned_s:
            self.fly_on(state, None)
            return Status.RUNNING
        self._planned_s = site_map.captured_s
        return self._go_on(state, self._way(site_map, goal))

    def _way(self, site_map: SiteMap, goal: Goal) -> WayTo:
        return way_to(
            (goal.x_m, goal.y_m),
            site_map,
            self.obstacles(),
            self.read(CORRIDOR).value,
            margins=self._margins,
            arrive_m=self.port_value("arrive_m"),
            most_mps=self.port_value("speed_mps"),
        )

    def _go_on(self, state: DroneState, way: WayTo) -> Status:
        """Fly the next part of the way, or look for one."""
        shorter = way.left_m < self._best_m - self.config.progress_m
        if way.course is not None and shorter:
            self._progress_s = self.leaf_clock.now()
        if shorter or way.left_m > self._best_m + self.config.progress_m:  # a new way counts anew
            self._best_m = way.left_m
        self.feedback_message = self._trouble = way.reason
        self._below = way.course is None and way.left_m <= self.config.below_m
        if self._below:  # the ground there is below the view in flight
            self.fly_on(state, Rotate(yaw_rad=way.bearing_rad, reason="looks down"))
        elif way.course is None:
            self.fly_on(state, Rotate(yaw_rad=self.config.look_rad, reason="looks"))
        elif isinstance(way.course, StepTo):
            self._steps += 1
            self.start_move(forward_m=way.course.forward_m, right_m=way.course.right_m)
        else:
            self.fly_on(state, way.course)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch, lower while the ground of a near place is looked for."""
        return self.config.below_rad if self._below else super().gimbal_pitch_rad()

    def _arrived(self, state: DroneState, site_map: SiteMap, goal: Goal) -> Status:
        """Turn to the heading of the place and climb to its height."""
        turn_rad = 0.0
        if goal.yaw_rad is not None:
            turn_rad = wrap_angle(goal.yaw_rad - site_map.pose.yaw_rad)
        self.feedback_message = self._trouble = "at the place"
        if abs(turn_rad) > self.config.facing_rad:
            self.fly_on(state, Rotate(yaw_rad=turn_rad, reason="turns"))
            return Status.RUNNING
        self.drop_course()
        too_high_m = self.too_high_m(state)
        if goal.height_m is not None and abs(too_high_m) > self.config.height_m:
            self.start_move(down_m=too_high_m)
            return Status.RUNNING
        return Status.SUCCESS if self.is_still(state) else Status.RUNNING
