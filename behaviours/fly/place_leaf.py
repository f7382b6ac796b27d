"""Base of the leaves that need a place on the map."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from behaviours.fly.course_leaf import CourseLeaf
from behaviours.fly.steering import GIVES_WAY
from uav_bt.board import FLIGHT_PITCH, ODOMETRY, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.plugins import make_mark_finder
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, Pose2D
from uav_bt.types.area import Area
from uav_bt.types.place import MissionRules, Place, PlaceFrame
from uav_bt.types.place_frames import Goal, Unresolved, from_start, resolve, start_place
from uav_bt.types.site_map import SiteMap

DOUBTED_S = 1.0
"""The map is not used when the views have contradicted it for longer (chosen)."""


@dataclass(frozen=True, kw_only=True)
class PlaceConfig:
    """When a place is reached. The numbers were chosen.

    Attributes:
        facing_rad: Largest error of a heading.
        faced_s: A place counts as faced after it was faced for this time.
        still_mps: Largest speed of a drone that stands still.
        height_m: Largest error of a height.
        steps: Last steps that are flown before the drone counts as arrived where it is.
        progress_m: A way that is shorter by this is progress.
        below_m: A place nearer than this may lie below the view in flight.
        below_rad: The camera's pitch that shows it.
        look_rad: Turn that is ordered while the drone looks for a way.
    """

    facing_rad: float = math.radians(4)
    faced_s: float = 0.3
    still_mps: float = 0.15
    height_m: float = 0.1
    steps: int = 2
    progress_m: float = 0.1
    below_m: float = 1.0
    below_rad: float = math.radians(-55)  # the map takes no steeper views
    look_rad: float = math.radians(60)


class PlaceLeaf(CourseLeaf):
    """Base of the leaves that need a place on the map."""

    points = True
    config: ClassVar[PlaceConfig] = PlaceConfig()
    place_port: ClassVar[Port[str] | None] = None  # the port that names the place
    reads = (*CourseLeaf.reads, FLIGHT_PITCH)
    needed = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Note poses and area, and check a place that is known before the take-off.

        Raises:
            InputError: The place is one of the lab's drawing, and neither the take-off pose nor a
                mark with a heading is known there; or the place lies outside the mission's area.
        """
        super().on_setup(mission)
        self._take_off, self._area = mission.take_off, mission.area
        self._mark, self._mark_kind = mission.mark_pose, mission.mark.kind
        self._mark_turns = self._mark is not None and make_mark_finder(mission.mark).shows_heading
        text = None if self.place_port is None else self.initial_value(self.place_port)
        if text is not None:
            self._check_before_flight(text)

    def refuses(self, rules: MissionRules) -> str | None:
        """Refuse a place outside the area of the rules, as far as the file tells."""
        corners = rules.area or ()
        text = None if self.place_port is None else self.initial_value(self.place_port)
        if text is None or not corners or any(one.frame is not PlaceFrame.START for one in corners):
            return None
        area = Area((tuple((one.x_m, one.y_m) for one in corners),))
        try:
            return _outside(text, Place.parse(text), None, area)
        except ValueRangeError:  # a heading
            return None

    def _check_before_flight(self, text: str) -> None:
        try:
            place = Place.parse(text)
        except ValueRangeError:  # a heading
            return
        if place.frame is PlaceFrame.LAB and self._take_off is None:
            self._check_mark(text)
        if (message := _outside(text, place, self._take_off, self._area)) is not None:
            raise InputError(message)

    def _check_mark(self, text: str) -> None:
        """Refuse a place of the drawing that no landing mark leads to."""
        if self._mark is not None and self._mark_turns:
            return
        why = ""
        if self._mark is not None:
            why = f" (the landing mark is known there, but a {self._mark_kind} shows no heading)"
        raise InputError(
            f"the place '{text}' needs the take-off pose in the lab's drawing{why}: give "
            "`take_off` in the site or lab file, and no random take-off in the scene"
        )

    def initialise(self) -> None:
        """Begin without a goal."""
        self.drop_course()
        self._place: Place | None = None  # `body:` is replaced by where it was at the beginning
        self._progress_s = self._worked_s = self.leaf_clock.now()

    def gives_way(self) -> bool:
        """Give way if the port is set; that time does not count as time without progress.

        The leaf calls it once in a tick.
        """
        now_s = self.leaf_clock.now()
        passed_s, self._worked_s = now_s - self._worked_s, now_s
        if not self.port_value(GIVES_WAY.name) or not self.give_way():
            return False
        self._progress_s += passed_s
        return True

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch in flight, or a lower one to show more ground."""
        flight_rad = self.read(FLIGHT_PITCH).value
        return None if flight_rad is None else self.ground_pitch_rad(flight_rad)

    def goal(self, site_map: SiteMap, text: str) -> Goal | Unresolved:
        """Return a place on the map.

        Args:
            site_map: The newest map.
            text: The place, as a port gives it.
        """
        place = self._place or Place.parse(text)
        found = resolve(place, site_map, self._take_off, self._mark)
        if isinstance(found, Goal) and self._area is not None:
            at_m = site_map.start.to_body(found.x_m, found.y_m)
            if self._area.margin_m(*at_m) < 0.0:
                return Unresolved(reason="the place lies outside the mission's area")
        if place.frame is PlaceFrame.BODY and isinstance(found, Goal):
            start = start_place(site_map, found.x_m, found.y_m, yaw_rad=found.yaw_rad)
            self._place = replace(start, height_m=place.height_m)
        return found

    def trusted_map(self) -> SiteMap | None:
        """Return the newest map; None without one, or while the views contradict it."""
        site_map = self.read(SITE_MAP).value
        return None if site_map is None or site_map.contradicted_s > DOUBTED_S else site_map

    def is_still(self, state: DroneState) -> bool:
        """Return whether the drone stands still over the ground."""
        motion = self.read(ODOMETRY).value
        velocity = state.velocity if motion is None else motion.velocity
        return math.hypot(velocity.forward_mps, velocity.right_mps) < self.config.still_mps

    def fails(self, reason: str) -> Status:
        """Return FAILURE, with its reason on the status line."""
        self.feedback_message = reason
        return Status.FAILURE


def _outside(text: str, place: Place, take_off: Pose2D | None, area: Area | None) -> str | None:
    """Return the message that a place lies outside an area; None where it does not, or may not."""
    at_m = from_start(place, take_off)
    if at_m is None or area is None or area.margin_m(*at_m) >= 0.0:
        return None
    return (
        f"the place '{text}' lies {-area.margin_m(*at_m):.1f} m outside the area of the mission: "
        "move it, or widen the area of <Rules/> and of the site or lab file"
    )
