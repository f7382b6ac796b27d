"""The leaves that estimate the motion over the ground and keep the map of the place."""

from __future__ import annotations

import math
from typing import Self

from behaviours.path.movers import RAISED_S
from behaviours.policies.view import current_view
from behaviours.ports import StageTimer
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, ODOMETRY, RAISED, SITE_MAP, STATE
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Status
from uav_bt.types.flight_results import EventKind
from uav_bt.types.site_map import SiteMap


class TrackMotion(Leaf):
    """Estimate the drone's pose and velocity over the ground in every tick; SUCCESS always.

    The estimate integrates telemetry. Each class map with enough ground in view corrects it. It is
    written from the first class map on. Leaves that need the drone's position (`MapSite`, the
    position hold) read it. Place this leaf after `Segment` and before `MapSite`.
    """

    answers = (Status.SUCCESS,)
    reads = (STATE, FRAME, CLASS_MAP, CAMERA)
    writes = (ODOMETRY,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the odometry."""
        from perception.odometry.ground import GroundOdometry  # noqa: PLC0415  (OpenCV is heavy)

        sight = mission.sight
        self._odometry = GroundOdometry(None if sight is None else sight.motion)
        self._timer = StageTimer(mission, "odometry")
        self._last_s = -1.0

    def on_inherit(self, former: Self) -> None:
        """Keep the odometry, and with it the origin of its frame."""
        self._odometry, self._last_s = former._odometry, former._last_s

    def update(self) -> Status:
        """Integrate telemetry, and correct the estimate with a new class map."""
        state = self.read(STATE).value
        if state is None:
            return Status.SUCCESS
        self._odometry.predict(state, self.clock.now())
        seen = current_view(self)
        if seen is not None and seen[0].captured_s != self._last_s:
            frame, class_map, camera = seen
            self._last_s = frame.captured_s
            with self._timer:
                self._odometry.see(class_map, frame, camera)
        motion = self._odometry.estimate
        if motion is not None:
            self.write(ODOMETRY, motion, captured_s=motion.pose.time_s)
        return Status.SUCCESS


class MapSite(Leaf):
    """Keep the map of the place; SUCCESS always.

    Place it after `TrackMotion`: a class map enters the map only with the drone's pose at its
    capture. A `FindMark` before it puts the landing mark on the map.
    """

    answers = (Status.SUCCESS,)
    reads = (FRAME, CLASS_MAP, CAMERA, ODOMETRY, MARK, RAISED)
    needed = (CLASS_MAP, ODOMETRY)
    writes = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make an empty map."""
        # Late: SciPy takes long to import and `uav-bt check` must answer at once.
        from perception.mapping.site_mapper import SiteMapper  # noqa: PLC0415

        self._mapper = SiteMapper(mission.classes, mark_m=mission.mark.radius_m)
        self._timer = StageTimer(mission, "map")
        self._last_s, self._raised = -math.inf, False  # whether the drone flies higher for movers

    def on_inherit(self, former: Self) -> None:
        """Keep the map and the drone's pose on it."""
        self._mapper, self._last_s, self._raised = former._mapper, former._last_s, former._raised

    def update(self) -> Status:
        """Add a new class map, and write the map with the drone's present pose."""
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, motion = self.read(CLASS_MAP).value, self.read(ODOMETRY).value
        self.feedback_message = ""
        if frame is None or camera is None or class_map is None:
            return Status.SUCCESS
        if motion is None:
            self.feedback_message = "no odometry: <TrackMotion/> must tick ahead of this leaf"
            return Status.SUCCESS
        with self._timer:
            seen, fix = current_view(self), self.read(MARK).value
            if seen is not None and self._last_s != frame.captured_s == motion.seen.time_s:
                self._last_s = frame.captured_s
                self._mapper.look(class_map, frame, seen[2], motion)
                if fix is not None and fix.detected:
                    self._mapper.see_mark(fix)
            site_map = self._mapper.map(motion)
        self._tell_of_movers(site_map)
        if self._last_s > -math.inf:
            self.write(SITE_MAP, site_map, captured_s=self._last_s)
        return Status.SUCCESS

    def _tell_of_movers(self, site_map: SiteMap) -> None:
        """Add an event when the leaf that flies begins and ends to fly higher for movers."""
        raised_m = self.read(RAISED).value  # None: no leaf gives way
        if raised_m is None or (raised_m > 0.0) == self._raised:
            return
        self._raised = not self._raised
        text = f"flies at the flight height again: no mover for {RAISED_S:.0f} s"
        if self._raised:
            place = ""
            if site_map.movers:
                newest = max(site_map.movers, key=lambda mover: mover.first_s)
                x_m, y_m = site_map.start.to_body(newest.x_m, newest.y_m)
                place = f" at start:{x_m:.1f},{y_m:.1f}"
            text = f"flies {raised_m:g} m higher: a mover{place}"
        self.mission.add_event(EventKind.INFO, text, self.path)
