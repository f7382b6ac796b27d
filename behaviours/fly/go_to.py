"""GoTo: fly to a place by the map."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

from behaviours.fly.mark_track import (
    SLOW_DOWN_PER_S,
    TRACK_KEYS,
    believed_fix,
    is_clear,
    straight_to,
)
from behaviours.fly.places import BELOW_RAD, FACING_RAD, NO_MAP, PlaceLeaf
from behaviours.fly.steering import GIVES_WAY
from behaviours.path.gimbal_pointing import mark_pitch_rad
from behaviours.path.margins import Margins
from behaviours.path.to_place import LAST_STEP_M, WayTo, way_to
from behaviours.ports import number
from uav_bt.answers import Rotate
from uav_bt.board import CORRIDOR, FLIGHT_HEIGHT, MARK, ODOMETRY, PHASE, SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MissionPhase, wrap_angle
from uav_bt.types.place import Place, PlaceFrame
from uav_bt.types.place_frames import Goal, Unresolved
from uav_bt.types.site_map import SiteMap

# The numbers were chosen.
_STILL_MPS: Final = 0.15  # largest speed of a drone that stands still
_HEIGHT_M: Final = 0.1  # largest error of a height
_STEPS: Final = 2  # last steps that are flown before the drone counts as arrived where it is
_PROGRESS_M: Final = 0.1  # a way that is shorter by this is progress
_BELOW_M: Final = 1.0  # a place nearer than this may lie below the view in flight
_MARK_OUTSIDE: Final = "the landing mark lies outside the mission's area"
_NOT_STRAIGHT: Final = "an obstacle is too near to the straight way to the mark, and no map is sure"
_LOOK_RAD: Final = math.radians(60)  # turn that is ordered while the drone looks for a way
# Without a usable map the drone flies straight to the mark, if no obstacle is nearer to that way
# than a route's distance and this, up to `_BEFORE_M` before the mark.
_STRAIGHT_MORE_M: Final = 0.12
_SAME_GAP_M: Final = 0.5  # narrow places this near to each other are one
_BEFORE_M: Final = 0.35
# Boxes beside the mark may end the way to it at this distance; the last metre is flown straight.
_FAR_M: Final = 0.9


class GoTo(PlaceLeaf):
    """Fly to a place over ground that the map shows free; SUCCESS there, standing still.

    The way keeps its distance from obstacles and edges to its end. Where no way is known the drone
    looks around, and FAILURE comes after `blocked_s` without progress. FAILURE comes at once for a
    place that cannot be found, such as an object that is not on the map.
    An override or a pilot interrupts the flight, and it goes on afterwards.

    To the landing mark the last metres may be narrower: the drone looks at a gap of 0.6 m before it
    flies it, and keeps to its middle. The camera follows the mark down. With an `arrive_m` of more
    than 0.35 m the leaf ends where the straight way on is free. Without a usable map the drone
    flies straight to the tracked mark while nothing is near that way; FAILURE comes at once where
    the mark is out of view, too.
    """

    place_port = Port(
        "to", str, doc="place, such as start:2,0 or mark", check=Place.parse, sample="start:2,0"
    )
    ports = (
        place_port,
        number("arrive_m", 0.15, 0.05, 2, "distance from the place that counts as there, m"),
        number("speed_mps", 0.6, 0.1, 2, "highest speed, m/s"),
        number("blocked_s", 10.0, 0, 3600, "time without progress until it fails, s"),
        number("gimbal_deg", 0.0, -90, 0, "camera pitch, degrees; 0: that of the take-off"),
        GIVES_WAY,
    )
    reads = (*PlaceLeaf.reads, *TRACK_KEYS, CORRIDOR)
    writes = (*PlaceLeaf.writes, FLIGHT_HEIGHT)

    def on_setup(self, mission: MissionContext) -> None:
        """Note the margins of the place."""
        super().on_setup(mission)
        margins = Margins(hull_m=mission.airframe.radius_m)
        self._margins = margins.within(mission.clearances, mission.mark)
        self._mark_m = mission.mark.height_m

    def needs(self) -> tuple[Key[Any], ...]:
        """Return the map; the landing mark is flown to without one as well."""
        text = self.initial_value(self.place_port)
        place = None if text is None else Place.parse(text)
        is_mark = place is not None and place.frame is PlaceFrame.MARK
        return (MARK,) if is_mark else self.needed

    def initialise(self) -> None:
        """Plan afresh."""
        super().initialise()
        place = Place.parse(self.port_value("to"))
        self._is_mark, self._turns = place.frame is PlaceFrame.MARK, place.heading_rad is not None
        self.in_gap = self._is_mark
        self.write(PHASE, MissionPhase.APPROACH if self._is_mark else MissionPhase.GO_TO)
        self._planned_s = self._best_m = math.inf
        self._steps = 0
        self._seen_gap: tuple[float, float] | None = None  # the last narrow place that was faced
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
            return self._without_map(state)
        found = self.goal(site_map, self.port_value("to"))
        if isinstance(found, Unresolved):
            return self.fails(found.reason)
        return self._towards(found, state, site_map)

    def _towards(self, goal: Goal, state: DroneState, site_map: SiteMap) -> Status:
        if goal.height_m is not None:
            self.write(FLIGHT_HEIGHT, goal.height_m)
        arrive_m, to_m = self.port_value("arrive_m"), site_map.pose.to_body(goal.x_m, goal.y_m)
        apart_m = math.dist((goal.x_m, goal.y_m), (site_map.pose.x_m, site_map.pose.y_m))
        ends_here = self._is_mark and arrive_m > LAST_STEP_M
        clear = ends_here and is_clear(self, *to_m)
        there = clear if ends_here else self._steps >= _STEPS or apart_m < arrive_m / 2
        if there and apart_m <= arrive_m:
            return self._arrived(state, site_map, goal)
        if site_map.captured_s == self._planned_s:
            self.fly_on(state, None)
            return Status.RUNNING
        self._planned_s = site_map.captured_s
        slow_mps = SLOW_DOWN_PER_S * apart_m if self._is_mark else math.inf
        way = way_to(
            (goal.x_m, goal.y_m),
            site_map,
            self.read(CORRIDOR).value,
            margins=self._margins,
            arrive_m=_FAR_M if ends_here else arrive_m,
            most_mps=min(self.port_value("speed_mps"), slow_mps),
            over=self._is_mark,
        )
        if clear and way.course is None and apart_m <= _FAR_M:
            return self._arrived(state, site_map, goal)
        return self._go_on(state, self._seeing_ahead(way, site_map) if self._is_mark else way)

    def _seeing_ahead(self, way: WayTo, site_map: SiteMap) -> WayTo:
        """Turn to a narrow place ahead, once: on a curve its inner side would stay out of view."""
        narrow, seen = way.narrow, self._seen_gap
        if narrow is None or (seen is not None and math.dist(narrow, seen) < _SAME_GAP_M):
            return way
        forward_m, right_m = site_map.pose.to_body(*narrow)
        to_rad = math.atan2(right_m, forward_m)
        if abs(to_rad) > FACING_RAD:
            return replace(way, course=Rotate(yaw_rad=to_rad), reason="looks ahead")
        self._seen_gap = narrow
        return way

    def _without_map(self, state: DroneState) -> Status:
        """Fly straight to the mark without a map, or while views contradict it; else wait."""
        if not self._is_mark:
            self._trouble = NO_MAP
            return Status.RUNNING
        fix = believed_fix(self, self._mark_m)
        if fix is None:
            return self.fails("the landing mark was not seen yet, or not for long")
        seen = self.read(MARK).value
        if seen is None or fix.captured_s != seen.captured_s:  # a place on a map that is in doubt
            return self.fails("the views contradict the map, and the landing mark is out of view")
        at_m, doubted = (fix.forward_m, fix.right_m), self.read(SITE_MAP).value
        x_m, y_m = (0.0, 0.0) if doubted is None else doubted.pose.to_world(*at_m)
        outside = doubted is not None and self.outside_m(doubted, Goal(x_m=x_m, y_m=y_m)) > 0.0
        if not outside and fix.range_m <= self.port_value("arrive_m") and is_clear(self, *at_m):
            self._trouble = "only the map knows the heading of the place"
            return Status.RUNNING if self._turns else Status.SUCCESS
        share = max(1.0 - _BEFORE_M / max(fix.range_m, _BEFORE_M), 0.0)
        to_m = share * at_m[0], share * at_m[1]
        margin_m = self._margins.touch_m + _STRAIGHT_MORE_M
        if outside or not is_clear(self, *to_m, margin_m=margin_m, assumed=True):
            return self.fails(_MARK_OUTSIDE if outside else _NOT_STRAIGHT)
        course = straight_to(fix)
        way = WayTo(course=course, left_m=fix.range_m, bearing_rad=0.0, reason=course.reason)
        return self._go_on(state, way)

    def _go_on(self, state: DroneState, way: WayTo) -> Status:
        """Fly the next part of the way, or look for one."""
        shorter = way.left_m < self._best_m - _PROGRESS_M
        if way.course is not None and shorter:
            self._progress_s = self.leaf_clock.now()
        if shorter or way.left_m > self._best_m + _PROGRESS_M:  # a new way counts anew
            self._best_m = way.left_m
        self.feedback_message = way.reason
        self._trouble = way.reason
        if way.reason.endswith(" left"):
            self._trouble = f"no progress, {way.reason}"
        self._below = way.course is None and way.left_m <= _BELOW_M
        if self._below:  # the ground there is below the view in flight
            self.fly_on(state, Rotate(yaw_rad=way.bearing_rad, reason="looks down"))
        elif way.course is None:
            self.fly_on(state, Rotate(yaw_rad=_LOOK_RAD, reason="looks"))
        elif isinstance(way.course, tuple):
            self._steps += 1
            self.start_move(forward_m=way.course[0], right_m=way.course[1])
        else:
            self.fly_on(state, way.course)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch, lower for the mark and for the ground of a near place."""
        state, given_deg = self.state(), self.port_value("gimbal_deg")
        if self._below:
            return BELOW_RAD
        flight_rad = super().gimbal_pitch_rad()
        if given_deg != 0.0:
            flight_rad = self.ground_pitch_rad(math.radians(given_deg))
        fix = believed_fix(self, self._mark_m) if self._is_mark else None
        if fix is None or state is None or flight_rad is None:
            return flight_rad
        return mark_pitch_rad(fix.range_m, state.height_above_ground_m - fix.height_m, flight_rad)

    def _arrived(self, state: DroneState, site_map: SiteMap, goal: Goal) -> Status:
        """Turn to the heading of the place and climb to its height."""
        turn_rad = 0.0
        if goal.yaw_rad is not None:
            turn_rad = wrap_angle(goal.yaw_rad - site_map.pose.yaw_rad)
        self.feedback_message = self._trouble = "at the place"
        if abs(turn_rad) > FACING_RAD:
            self.fly_on(state, Rotate(yaw_rad=turn_rad, reason="turns"))
            return Status.RUNNING
        self.drop_course()
        too_high_m, motion = self.too_high_m(state), self.read(ODOMETRY).value
        if goal.height_m is not None and abs(too_high_m) > _HEIGHT_M:
            self.start_move(down_m=too_high_m)
            return Status.RUNNING
        velocity = state.velocity if motion is None else motion.velocity
        still = math.hypot(velocity.forward_mps, velocity.right_mps) < _STILL_MPS
        return Status.SUCCESS if still else Status.RUNNING
