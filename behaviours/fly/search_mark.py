"""Leaves that search for the landing mark: by the site map, under a policy, below the drone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from behaviours.fly.course_leaf import GIMBAL, CourseLeaf
from behaviours.fly.mark_track import (
    MARK_GONE,
    TRACK,
    TRACK_KEYS,
    TRACK_TRIED,
    believed_fix,
    mark_of,
)
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from behaviours.path.gimbal_pointing import mark_pitch_rad
from behaviours.path.map_search import Aim, Course, MapSearch, MapSearchConfig
from behaviours.path.next_viewpoint import GroundInView
from uav_bt.answers import Done
from uav_bt.board import CAMERA, CORRIDOR, PHASE, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import DroneState, MissionPhase
from uav_bt.types.site_map import SiteMap


class MarkFound(Leaf):
    """SUCCESS while the landing mark is in view, or its track is precise enough to fly to.

    A track that did not lead to the mark counts again after a new sighting.
    """

    condition = True
    reads = (*TRACK_KEYS, TRACK_TRIED)

    def update(self) -> Status:
        """Judge the track."""
        fix, tried_s = believed_fix(self), self.read(TRACK_TRIED).value
        if fix is None:
            return Status.FAILURE
        carried = fix.std_m <= TRACK.carried_std_m and (tried_s is None or fix.captured_s > tried_s)
        return Status.SUCCESS if fix.detected or carried else Status.FAILURE


class SearchByMap(CourseLeaf):
    """Fly to the map's landing mark, or without one to viewpoints of unseen ground.

    SUCCESS where the mark should be ahead or below but `MarkFound` does not find it: it may be
    below the view. FAILURE without a map, or if the map has no path. With `to_mark="false"` also
    FAILURE when all ground was seen: no more ground can show a way to the mark.
    """

    points = True
    ports = (
        replace(GIMBAL, at_setup=True),
        Port(
            "to_mark",
            bool,
            default=True,
            doc="whether the place of the mark is flown to first",
            at_setup=True,
        ),
    )
    reads = (*CourseLeaf.reads, *TRACK_KEYS, CAMERA, CORRIDOR)
    writes = (*CourseLeaf.writes, MARK_GONE)

    def on_setup(self, mission: MissionContext) -> None:
        """Begin a search; the searched places are remembered for the whole mission."""
        super().on_setup(mission)
        config = MapSearchConfig()
        margins = config.margins.within(mission.clearances)
        self._to_mark: bool = self.port_value("to_mark")
        self._search = MapSearch(replace(config, margins=margins, repeats=self._to_mark))
        self._mark_m = mission.mark.height_m
        self._planned_s = -math.inf  # capture time of the map of the last plan
        self._led = False  # whether that map had a path
        self._flight_rad = math.radians(self.port_value("gimbal_deg"))

    def initialise(self) -> None:
        """Choose a new goal."""
        self._search.pause()
        self.drop_course()
        self.write(PHASE, MissionPhase.SEARCH if self._to_mark else MissionPhase.APPROACH)

    def work(self, state: DroneState) -> Status:
        """Plan on each new map; follow the last plan in between."""
        site_map = self.read(SITE_MAP).value
        if site_map is None:
            return Status.FAILURE
        course = None
        if site_map.captured_s > self._planned_s:
            self._planned_s = site_map.captured_s
            course = self._plan(site_map, state)
            self._led = course is not None
        if not self._led:
            return Status.FAILURE
        if isinstance(course, Done):
            self._led = False
            if site_map.mark is not None:
                self.write(MARK_GONE, site_map.mark.seen_s)
            return Status.SUCCESS
        if course is not None:
            self.feedback_message = course.reason
        self.fly_on(state, course)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch: towards the mark's place, else lower where ground ends."""
        site_map, state, mark = self.read(SITE_MAP).value, self.state(), mark_of(self)
        if site_map is None or state is None:
            return self._flight_rad
        if mark is not None and self._search.aim is Aim.MARK:
            range_m = math.hypot(mark.x_m - site_map.pose.x_m, mark.y_m - site_map.pose.y_m)
            above_m = state.height_above_ground_m - self._mark_m
            return mark_pitch_rad(range_m, above_m, self._flight_rad)
        # Viewpoints are chosen for views at the pitch in flight.
        return self._flight_rad if self._search.looks else self.ground_pitch_rad(self._flight_rad)

    def _plan(self, site_map: SiteMap, state: DroneState) -> Course | None:
        camera = self.read(CAMERA).value
        if camera is None:
            return None
        far_m = self._search.config.view.far_m
        in_view = GroundInView.of(camera, self._flight_rad, state.height_above_ground_m, far_m)
        corridor = self.read(CORRIDOR).value
        mark = mark_of(self) if self._to_mark else None
        return self._search.decide(site_map, mark, self.obstacles(), corridor, in_view)


class SearchUnderPolicy(SteeringLeaf):
    """Advance and turn as a leaf policy decides; FAILURE when it is time to look below.

    A mark nearer than about a metre is below the forward view.
    """

    points = True
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (
        *(POLICY, FLOWING, GIMBAL),
        Port(
            "first_s", float, default=12.0, least=0, most=3600, doc="until the first look below, s"
        ),
        Port("next_s", float, default=30.0, least=0, most=3600, doc="until each further one, s"),
    )

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; the time begins with the first search."""
        super().on_setup(mission)
        self._scan_s: float | None = None

    def initialise(self) -> None:
        """Only views captured from now on count."""
        self.drop_course()
        self.write(PHASE, MissionPhase.SEARCH)
        if self._scan_s is None:
            self._scan_s = self.leaf_clock.now() + self.port_value("first_s")

    def work(self, state: DroneState) -> Status:
        """Advance and turn until the next look below is due."""
        now_s = self.leaf_clock.now()
        if self._scan_s is not None and now_s >= self._scan_s and not self.busy:
            self._scan_s = now_s + self.port_value("next_s")
            return Status.FAILURE
        self.wander(state)
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight: policies expect views at that pitch."""
        return math.radians(self.port_value("gimbal_deg"))


@dataclass(frozen=True, kw_only=True)
class ScanConfig:
    """How the ground below is scanned.

    Attributes:
        yaw_rate_radps: Rate of the turn: 5 degrees per frame at 10 frames per second.
    """

    yaw_rate_radps: float = 0.8


class ScanBelow(CourseLeaf):
    """Make one full turn with the camera down; FAILURE at its end."""

    points = True
    answers = (Status.FAILURE, Status.RUNNING)
    config: ClassVar[ScanConfig] = ScanConfig()
    ports = (
        Port("gimbal_deg", float, default=-65.0, least=-90, most=90, doc="camera pitch, degrees"),
    )

    def initialise(self) -> None:
        """Begin the turn."""
        self.write(PHASE, MissionPhase.SEARCH)
        self._left_rad = 2.0 * math.pi
        self._yaw_rad: float | None = None

    def work(self, state: DroneState) -> Status:
        """Turn."""
        yaw_rad = state.attitude.yaw_rad
        if self._yaw_rad is not None:
            self._left_rad -= math.remainder(yaw_rad - self._yaw_rad, 2.0 * math.pi)
        self._yaw_rad = yaw_rad
        if self._left_rad <= 0.0:
            return Status.FAILURE
        self.feedback_message = "looks down"
        self.propose(self.turn_keeping_away(self.config.yaw_rate_radps))
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch of the scan."""
        return math.radians(self.port_value("gimbal_deg"))
