"""Base of the leaves that need a place on the map, and Face, which turns to one."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar, Final

from behaviours.fly.course_leaf import CourseLeaf
from behaviours.fly.steering import GIVES_WAY
from behaviours.ports import number
from uav_bt.answers import Rotate
from uav_bt.board import FLIGHT_PITCH, PHASE, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.plugins import make_mark_finder
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, MissionPhase, Pose2D, wrap_angle
from uav_bt.types.area import Area
from uav_bt.types.place import MissionRules, Place, PlaceFrame
from uav_bt.types.place_frames import Goal, Unresolved, from_start, resolve, start_place
from uav_bt.types.site_map import SiteMap

# When a place is reached. The numbers were chosen.
_DOUBTED_S: Final = 1.0  # the map is not used when the views have contradicted it for longer
FACING_RAD: Final = math.radians(4)  # largest error of a heading
_FACED_S: Final = 0.3  # a place counts as faced after this time
BELOW_RAD: Final = math.radians(-55)  # shows the ground ahead; the map takes no steeper views
NO_MAP: Final = "no map, or the views contradict it"


class PlaceLeaf(CourseLeaf):
    """Base of the leaves that need a place on the map."""

    points = True
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
        self._mark = mission.mark_pose
        text = None if self.place_port is None else self.initial_value(self.place_port)
        place = None if text is None else _place(text)
        if text is None or place is None:
            return
        turns = self._mark is not None and make_mark_finder(mission.mark).shows_heading
        if place.frame is PlaceFrame.LAB and self._take_off is None and not turns:
            kind = mission.mark.kind
            why = f" (the landing mark is known there, but a {kind} shows no heading)"
            raise InputError(
                f"the place '{text}' needs the take-off pose in the lab's drawing"
                f"{'' if self._mark is None else why}: give "
                "`take_off` in the site or lab file, and no random take-off in the scene"
            )
        if (message := _outside(text, place, self._take_off, self._area)) is not None:
            raise InputError(message)

    def refuses(self, rules: MissionRules) -> str | None:
        """Refuse a place outside the area of the rules, as far as the file tells."""
        corners = rules.area or ()
        text = None if self.place_port is None else self.initial_value(self.place_port)
        place = None if text is None else _place(text)
        if text is None or place is None or not corners:
            return None
        if any(one.frame is not PlaceFrame.START for one in corners):
            return None
        return _outside(text, place, None, Area((tuple((one.x_m, one.y_m) for one in corners),)))

    def initialise(self) -> None:
        """Begin without a goal."""
        self.drop_course()
        self._place: Place | None = None  # `body:` is replaced by where it was at the beginning
        self._progress_s = self._worked_s = self.leaf_clock.now()

    @property
    def task(self) -> str:
        """The leaf's name, and its place."""
        place = "" if self.place_port is None else f" {self.port_value(self.place_port.name)}"
        return f"{self.name}{place}"

    def gives_way(self) -> bool:
        """Avoid a mover if the port `gives_way` is set; that time is not one without progress.

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
        """Return a place, as a port gives it, on the newest map."""
        place = self._place or Place.parse(text)
        found = resolve(place, site_map, self._take_off, self._mark)
        outside_m = self.outside_m(site_map, found) if isinstance(found, Goal) else 0.0
        if outside_m > 0.0:
            return Unresolved(reason=f"the place lies {outside_m:.2f} m outside the mission's area")
        if place.frame is PlaceFrame.BODY and isinstance(found, Goal):
            start = start_place(site_map, found.x_m, found.y_m, yaw_rad=found.yaw_rad)
            self._place = replace(start, height_m=place.height_m)
        return found

    def outside_m(self, site_map: SiteMap, place: Goal) -> float:
        """Return how far a place of the map lies outside the mission's area; 0 inside."""
        at_m = site_map.start.to_body(place.x_m, place.y_m)
        return 0.0 if self._area is None else max(-self._area.margin_m(*at_m), 0.0)

    def trusted_map(self) -> SiteMap | None:
        """Return the newest map; None without one, or while the views contradict it."""
        site_map = self.read(SITE_MAP).value
        return None if site_map is None or site_map.contradicted_s > _DOUBTED_S else site_map


def _place(text: str) -> Place | None:
    """Return the place of a text; None for a heading of `Face`."""
    try:
        return Place.parse(text)
    except ValueRangeError:
        return None


def _outside(text: str, place: Place, take_off: Pose2D | None, area: Area | None) -> str | None:
    """Return the message that a place lies outside an area; None where it does not, or may not."""
    at_m = from_start(place, take_off)
    if at_m is None or area is None or area.margin_m(*at_m) >= 0.0:
        return None
    return (
        f"the place '{text}' lies {-area.margin_m(*at_m):.1f} m outside the area of the mission: "
        "move it, or widen the area of <Rules/> and of the site or lab file"
    )


def _facing(text: str) -> float | Place:
    """Return the heading, radians, or the place of a text; raises ValueRangeError for neither."""
    try:
        degrees = float(text)
    except ValueError:
        return Place.parse(text)
    if not math.isfinite(degrees):
        raise ValueRangeError(f"expected a heading in degrees, or a place, got '{text}'")
    return math.radians(math.remainder(degrees, 360.0))


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
    ports = (place_port, number("give_up_s", 15.0, 0, 3600, "time until it fails, s"), GIVES_WAY)

    def initialise(self) -> None:
        """Begin the turn."""
        super().initialise()
        self.write(PHASE, MissionPhase.LOOK)
        self._faced_s = self.leaf_clock.now()  # it has been faced since

    def work(self, state: DroneState) -> Status:
        """Turn until the place is ahead."""
        now_s = self.leaf_clock.now()
        if now_s - self._progress_s > self.port_value("give_up_s"):
            return self.fails("does not face it in time")
        if self.gives_way():
            self._faced_s = now_s
            return Status.RUNNING
        site_map = self.trusted_map()
        if site_map is None:
            self.feedback_message = NO_MAP
            return Status.RUNNING
        text = self.port_value("at")
        facing = _facing(text)
        if isinstance(facing, float):
            turn_rad = wrap_angle(site_map.start.yaw_rad + facing - site_map.pose.yaw_rad)
        else:
            found = self.goal(site_map, text)
            if isinstance(found, Unresolved):
                return self.fails(found.reason)
            forward_m, right_m = site_map.pose.to_body(found.x_m, found.y_m)
            turn_rad = math.atan2(right_m, forward_m)
        self.feedback_message = f"{math.degrees(turn_rad):.0f} deg left"
        if abs(turn_rad) > FACING_RAD:
            self._faced_s = now_s
        if now_s - self._faced_s >= _FACED_S:
            return Status.SUCCESS
        self.fly_on(state, Rotate(yaw_rad=turn_rad, reason="faces"))
        return Status.RUNNING
