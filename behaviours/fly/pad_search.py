"""The search for the helipad: by the map of the place, or under a leaf policy without one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from behaviours.fly.ground_pointing import pitch_showing_ground
from behaviours.fly.steering import SteeringLeaf
from behaviours.fly.wander import wander
from behaviours.path.gimbal_pointing import mark_pitch_rad
from behaviours.path.map_search import Aim, Course, MapSearch
from behaviours.path.next_viewpoint import GroundInView
from uav_bt.answers import Done
from uav_bt.board import CAMERA, CORRIDOR, HELIPAD, OBSTACLES, PHASE, SITE_MAP
from uav_bt.tree import Status
from uav_bt.types import DroneState, HelipadFix, MissionPhase, Velocity
from uav_bt.types.site_map import MapMark, SiteMap


@dataclass(frozen=True, kw_only=True)
class PadSearchConfig:
    """When the floor below is scanned, and which track needs no search."""

    # Nearer than about a metre the pad is below the forward view, so a search under a policy that
    # lasts scans the floor below, once round with the camera tilted down. A search by the map does
    # where the pad should be and is not.
    first_scan_s: float = 12.0  # after the search began
    next_scan_s: float = 30.0  # after the last scan
    scan_pitch_rad: float = math.radians(-65)
    scan_rate_radps: float = 0.8
    track_std_m: float = 0.3  # a pad that is carried this well is flown to without a search
    by_map_m: float = 1.5  # further away, that goes by the map where it knows a way
    agrees_m: float = 0.7  # a pad further from the map's mark is another thing


class PadSearch:
    """Looks for the pad until it is in view.

    Args:
        leaf: that moves and sees; it declares `HELIPAD` beside what steering leaves read.
        flight_rad: the camera's pitch while searching, negative down.
        by_map: search by the map where there is one, and fly to a pad that is only carried.
        config: when it scans.
    """

    def __init__(
        self,
        leaf: SteeringLeaf,
        *,
        flight_rad: float,
        by_map: bool,
        config: PadSearchConfig | None = None,
    ) -> None:
        self._leaf, self._flight_rad, self._by_map = leaf, flight_rad, by_map
        self._config = config or PadSearchConfig()
        self._map = MapSearch()
        self._gone_s = -math.inf  # the mark was not where the map had it up to then
        self._planned_s = -math.inf  # the newest map that was planned on
        self._led = False  # the map knew a way
        self._tried_s = -math.inf  # a track that was last seen then did not lead to the pad
        self._next_scan_s = 0.0
        self._to_scan_rad = self._scan_yaw_rad = 0.0

    def start_clock(self) -> None:
        """Count the time to the first scan from now on."""
        self._next_scan_s = self._leaf.leaf_clock.now() + self._config.first_scan_s

    def begin(self) -> None:
        """Begin, or go on after an approach that failed."""
        self._to_scan_rad = 0.0
        self._map.pause()
        self._leaf.drop_course()
        self._leaf.write(PHASE, MissionPhase.SEARCH)

    def gave_up(self, fix: HelipadFix | None) -> None:
        """Note that the approach by a track has ended: as it is now it is not tried again."""
        if fix is not None:
            self._tried_s = fix.captured_s

    def believes(self, fix: HelipadFix) -> bool:
        """Return whether a pad may be there: at the map's mark, or on the ground where it has none.

        A mask may take something far behind the ground's edge for the pad.
        """
        site_map = self._site_map()
        if site_map is None:
            return True
        x_m, y_m = site_map.pose.to_world(fix.forward_m, fix.right_m)
        mark = self._mark_of(site_map)
        if mark is None:
            return not site_map.is_beyond_edge(x_m, y_m)
        return math.hypot(x_m - mark.x_m, y_m - mark.y_m) <= self._config.agrees_m

    def work(self, state: DroneState) -> Status:
        """Search; SUCCESS when the pad is in view, or carried well enough to be flown to.

        A pad further away is flown to by the map first, which knows what stands before it.
        """
        fix = self._found()
        self._leaf.write(PHASE, MissionPhase.SEARCH if fix is None else MissionPhase.APPROACH)
        if fix is not None:
            far = fix.range_m > self._config.by_map_m
            if far and self._to_scan_rad <= 0.0 and self._follow_map(state, to_mark=True):
                return Status.RUNNING
            return Status.SUCCESS
        if self._to_scan_rad > 0.0:
            self._scan(state)
        elif not self._follow_map(state):
            self._search_under_policy(state)
        return Status.RUNNING

    def pitch_rad(self) -> float:
        """Return the camera's pitch: at the mark's place when it is near, down in a scan."""
        if self._to_scan_rad > 0.0:
            return self._config.scan_pitch_rad
        site_map, state = self._site_map(), self._leaf.state()
        if site_map is None or state is None:
            return self._flight_rad
        mark = self._mark_of(site_map)
        if mark is None or self._map.aim is not Aim.MARK:
            # A policy knows views of one pitch, and a view was chosen for what it shows at that.
            if not self._led or self._map.looks:
                return self._flight_rad
            return pitch_showing_ground(self._leaf, self._flight_rad)
        range_m = math.hypot(mark.x_m - site_map.pose.x_m, mark.y_m - site_map.pose.y_m)
        return mark_pitch_rad(range_m, state.height_above_carpet_m, self._flight_rad)

    def _found(self) -> HelipadFix | None:
        """Return the pad that can be flown to."""
        fix = self._leaf.read(HELIPAD).value
        if fix is None or not self.believes(fix):
            return None
        carried = fix.std_m <= self._config.track_std_m and fix.captured_s > self._tried_s
        return fix if fix.detected or (self._by_map and carried) else None

    def _mark_of(self, site_map: SiteMap) -> MapMark | None:
        mark = site_map.mark
        return mark if mark is not None and mark.seen_s > self._gone_s else None

    def _site_map(self) -> SiteMap | None:
        return self._leaf.read(SITE_MAP).value if self._by_map else None

    def _follow_map(self, state: DroneState, *, to_mark: bool = False) -> bool:
        """Fly by the map; False when there is none, or none that knows a way.

        Args:
            state: of the drone.
            to_mark: only to the landing mark.
        """
        site_map = self._site_map()
        if site_map is None:
            return False
        if self._leaf.busy:
            self._leaf.moving(state)  # a step that began without the map ends first
            return True
        if site_map.captured_s > self._planned_s:
            self._planned_s = site_map.captured_s
            self._plan(site_map, state, to_mark=to_mark)
        elif self._led:
            self._leaf.fly_on(state, None)
        return self._led

    def _plan(self, site_map: SiteMap, state: DroneState, *, to_mark: bool) -> None:
        course = self._decide(site_map, state)
        if to_mark and (isinstance(course, Done) or self._map.aim is not Aim.MARK):
            course = None
        self._led = course is not None
        if course is None:
            return
        if self._leaf.turning:
            self._leaf.drop_course()
        if isinstance(course, Done):
            self._map.pause()
            if site_map.mark is not None:
                self._gone_s = site_map.mark.seen_s
            self._begin_scan(state)
            return
        self._leaf.feedback_message = course.reason
        self._leaf.fly_on(state, course)

    def _decide(self, site_map: SiteMap, state: DroneState) -> Course | None:
        camera = self._leaf.read(CAMERA).value
        if camera is None:
            return None
        far_m = self._map.config.view.far_m
        sight = GroundInView.of(camera, self._flight_rad, state.height_above_carpet_m, far_m)
        obstacles, corridor = self._leaf.read(OBSTACLES).value, self._leaf.read(CORRIDOR).value
        return self._map.decide(site_map, self._mark_of(site_map), obstacles, corridor, sight)

    def _search_under_policy(self, state: DroneState) -> None:
        if self._leaf.leaf_clock.now() >= self._next_scan_s and not self._leaf.busy:
            self._begin_scan(state)
            return
        wander(self._leaf, state)

    def _begin_scan(self, state: DroneState) -> None:
        self._next_scan_s = self._leaf.leaf_clock.now() + self._config.next_scan_s
        self._to_scan_rad = 2.0 * math.pi
        self._scan_yaw_rad = state.attitude.yaw_rad
        self._leaf.drop_course()

    def _scan(self, state: DroneState) -> None:
        """Turn once round with the camera down."""
        yaw_rad = state.attitude.yaw_rad
        self._to_scan_rad -= math.remainder(yaw_rad - self._scan_yaw_rad, 2.0 * math.pi)
        self._scan_yaw_rad = yaw_rad
        if self._to_scan_rad <= 0.0:
            self.begin()
            return
        self._leaf.feedback_message = "looks down"
        self._leaf.propose(Velocity(yaw_rate_radps=self._config.scan_rate_radps))
