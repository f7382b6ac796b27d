"""Leaves that fly to the landing mark: by the map, around an obstacle, and the last metre."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from behaviours.fly.course_leaf import GIMBAL, CourseLeaf
from behaviours.fly.mark_track import (
    TRACK,
    TRACK_KEYS,
    TRACK_TRIED,
    believed_fix,
    is_at_mark,
    is_clear,
    straight_to,
)
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from behaviours.path.following import UNMAPPED_S, follow
from behaviours.path.gimbal_pointing import LookingDown, mark_pitch_rad, shows_unplaced
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import CORRIDOR, PHASE, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MarkFix, MissionPhase
from uav_bt.types.site_map import SiteMap

ARRIVE = Port(
    "arrive_m",
    float,
    default=0.12,
    least=0.01,
    most=2,
    doc="horizontal distance that counts as above, m",
)


class MarkLeaf(CourseLeaf):
    """Base of the leaves whose camera follows the landing mark down."""

    points = True
    reads = (*CourseLeaf.reads, *TRACK_KEYS)
    ports: ClassVar[tuple[Port[Any], ...]] = (GIMBAL,)

    def on_setup(self, mission: MissionContext) -> None:
        """Begin with the camera at the pitch in flight."""
        super().on_setup(mission)
        self._looking = LookingDown()

    def initialise(self) -> None:
        """Write the mission's phase."""
        self.write(PHASE, MissionPhase.APPROACH)

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch: down at obstacles of unknown range, else at the mark."""
        flight_rad = math.radians(self.port_value("gimbal_deg"))
        fix, state = believed_fix(self), self.state()
        if fix is None or state is None:
            return flight_rad
        if fix.range_m <= TRACK.look_down_m:
            looks_rad = self._looking.pitch_rad(self.obstacles(), self.clock.now())
            if looks_rad is not None:
                return looks_rad
        return mark_pitch_rad(fix.range_m, state.height_above_ground_m - fix.height_m, flight_rad)


@dataclass(frozen=True, kw_only=True)
class GoToMarkConfig:
    """How the drone flies to the mark. The numbers were chosen in flights on the training scenes.

    Attributes:
        margins: Distances that the route keeps.
        near_m: Preferred largest distance from the route's end to the mark.
        far_m: Largest distance from the route's end to the mark if no route ends within `near_m`.
        nearer_m: If no route ends within `far_m`, a route must end at least this much nearer to the
            mark than the drone is.
        doubted_s: The map is not used when the views have contradicted it for longer.
        unplaced_rad: Half angle ahead in which an obstacle of unknown range stops the drone.
        blocked_s: The way counts as blocked when such an obstacle has stopped the drone for longer.
        detour_s: The leaf fails for this time after the way was blocked.
        straight_more_m: The straight way without a usable map keeps `touch_m` and this from
            obstacles.
        before_m: The straight way is checked up to this distance before the mark.
    """

    margins: Margins = field(default_factory=Margins)
    near_m: float = 0.15
    far_m: float = 0.9
    nearer_m: float = 0.5
    doubted_s: float = 1.0
    unplaced_rad: float = math.radians(30)
    blocked_s: float = 2.0
    detour_s: float = 1.0
    straight_more_m: float = 0.12
    before_m: float = 0.35


class GoToMark(MarkLeaf):
    """Fly to the tracked landing mark over the map; SUCCESS where the last metre to it is clear.

    Without a map, or while the views contradict it, the drone flies straight to the mark as long as
    no obstacle is near that path. FAILURE when no path is known or the track is lost.
    """

    config: ClassVar[GoToMarkConfig] = GoToMarkConfig()
    reads = (*MarkLeaf.reads, CORRIDOR)

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a route."""
        super().on_setup(mission)
        self._margins = self.config.margins.within(mission.clearances, mission.mark)
        self._planned_s = -math.inf  # capture time of the map of the last plan
        self._blocked_until_s = self._clear_s = -math.inf

    def initialise(self) -> None:
        """Plan afresh."""
        super().initialise()
        self._planned_s = -math.inf
        self._clear_s = self.leaf_clock.now()
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Plan on each new map; follow the last plan in between."""
        fix, now_s = believed_fix(self), self.leaf_clock.now()
        if fix is None or now_s < self._blocked_until_s:
            return Status.FAILURE
        if is_at_mark(fix, self.clock.now()) and is_clear(self, fix):
            return Status.SUCCESS
        answer: FollowLeg | Rotate | None
        if self._is_blocked_ahead(fix):
            waits = now_s - self._clear_s <= self.config.blocked_s
            answer = Rotate(yaw_rad=fix.bearing_rad, reason="looks down") if waits else None
        else:
            self._clear_s = now_s
            site_map = self.read(SITE_MAP).value
            if site_map is not None and site_map.captured_s == self._planned_s:
                self.fly_on(state, None)
                return Status.RUNNING
            answer = self._plan(site_map, fix)
        if answer is None:
            self._blocked_until_s = now_s + self.config.detour_s
            self.feedback_message = "no way"
            return Status.FAILURE
        self.feedback_message = answer.reason
        self.fly_on(state, answer)
        return Status.RUNNING

    def _plan(self, site_map: SiteMap | None, fix: MarkFix) -> FollowLeg | Rotate | None:
        """Return the course; None when no path is known."""
        if site_map is None or site_map.contradicted_s > self.config.doubted_s:
            return self._straight(fix)
        self._planned_s = site_map.captured_s
        return self._over(site_map, fix)

    def _is_blocked_ahead(self, fix: MarkFix) -> bool:
        """Return whether an obstacle of unknown range is ahead, with the mark some way off."""
        near = TRACK.at_mark_m < fix.range_m <= TRACK.look_down_m
        return near and shows_unplaced(self.obstacles(), self.config.unplaced_rad)

    def _over(self, site_map: SiteMap, fix: MarkFix) -> FollowLeg | Rotate | None:
        """Return the course over the map; None when the map has no path."""
        cfg = self.config
        to = site_map.pose.to_world(fix.forward_m, fix.right_m)
        recent = recent_obstacles(self.obstacles(), site_map, unmapped_s=UNMAPPED_S)
        maps = ClearanceMaps(site_map, recent, self._margins, crossing=True, over=to)
        route = maps.route_to(to, near_m=cfg.near_m, far_m=cfg.far_m)
        if route is None:  # fly as near as known ground leads; from there more is seen
            nearer_m = fix.range_m - cfg.nearer_m
            route = maps[Passage.ORDINARY].route_to(to, near_m=cfg.near_m, far_m=nearer_m)
        if route is None or len(route.path_m) == 1:
            return None
        return follow(
            route,
            site_map,
            self.read(CORRIDOR).value,
            most_mps=TRACK.slow_down_per_s * fix.range_m,
            reason=f"mark {fix.range_m:.1f} m",
        )

    def _straight(self, fix: MarkFix) -> FollowLeg | Rotate | None:
        """Return the straight course; None when a seen obstacle is near it."""
        cfg, reading = self.config, self.read(SITE_MAP)
        if reading.value is None:  # a tree may lack a map; a stale map permits nothing
            return straight_to(fix) if math.isinf(reading.age_s) else None
        share = max(fix.range_m - cfg.before_m, 0.0) / max(fix.range_m, cfg.before_m)
        to = share * fix.forward_m, share * fix.right_m
        margin_m = self._margins.touch_m + cfg.straight_more_m
        return straight_to(fix) if reading.value.near.allows(*to, margin_m=margin_m) else None


class StopAboveMark(MarkLeaf):
    """Fly the last metre straight by the track; SUCCESS above the mark, FAILURE when it is lost.

    The mark may have left the view by the lower edge.
    """

    ports = (*MarkLeaf.ports, ARRIVE)
    writes = (*MarkLeaf.writes, TRACK_TRIED)
    # A mark behind the drone and nearer than this is in view of a camera that looks straight down
    # (chosen).
    passed_m: ClassVar[float] = 0.35

    def initialise(self) -> None:
        """Drop the course."""
        super().initialise()
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Fly on until above the mark."""
        fix = believed_fix(self)
        if fix is None:
            return Status.FAILURE
        passed = fix.forward_m < 0.0 and fix.range_m < self.passed_m
        if passed or fix.range_m < self.port_value("arrive_m"):
            # If no mark is found below, the track counts again only after a new sighting.
            self.write(TRACK_TRIED, fix.captured_s)
            return Status.SUCCESS
        if not is_clear(self, fix):
            return Status.FAILURE
        answer = straight_to(fix)
        self.feedback_message = answer.reason
        self.fly_on(state, answer)
        return Status.RUNNING


class Detour(SteeringLeaf):
    """Turn away and take steps as a leaf policy decides; FAILURE after them, or without a track.

    It ends in FAILURE, so that the next leaf faces the mark again.
    """

    points = True
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (
        *(POLICY, FLOWING, GIMBAL),
        Port("steps", int, default=2, least=1, most=100, doc="steps that are taken"),
        Port(
            "turn_away_deg",
            float,
            default=0.0,
            least=0,
            most=360,
            doc="least turn at its beginning, to the side of the turn that is held, degrees",
        ),
    )
    reads = (*SteeringLeaf.reads, *TRACK_KEYS)

    def initialise(self) -> None:
        """Begin; only views captured from now on count."""
        self.drop_course()
        self._begun, self._steps = False, 0

    def work(self, state: DroneState) -> Status:
        """Continue a step or a turn, or begin the next one."""
        if believed_fix(self) is None:
            return Status.FAILURE
        away_rad = math.radians(self.port_value("turn_away_deg"))
        if not self._begun and away_rad > 0.0:
            self.keep_turning(state, away_rad)
        elif self._steps >= self.port_value("steps"):
            if not self.moving(state):
                return Status.FAILURE
        elif self.wander(state):
            self._steps += 1
        self._begun = True
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight: policies expect views at that pitch."""
        return math.radians(self.port_value("gimbal_deg"))
