"""The leaf that keeps the map of the place."""

from __future__ import annotations

import math
from typing import Self

from behaviours.stage_timer import StageTimer
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, ODOMETRY, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Status


class MapSite(Leaf):
    """Keep the map of the place; SUCCESS always.

    Place it after `TrackMotion`: a class map enters the map only with the drone's pose at its
    capture. A `FindMark` before it puts the landing mark on the map.
    """

    answers = (Status.SUCCESS,)
    reads = (FRAME, CLASS_MAP, CAMERA, ODOMETRY, MARK)
    needed = (ODOMETRY,)
    writes = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make an empty map."""
        # Late: SciPy takes long to import and `uav-bt check` must answer at once.
        from perception.mapping.site_mapper import SiteMapper  # noqa: PLC0415

        self._mapper = SiteMapper(mission.classes, mark_m=mission.mark.radius_m)
        self._timer = StageTimer(mission, "map")
        self._last_s = -math.inf

    def on_inherit(self, former: Self) -> None:
        """Keep the map and the drone's pose on it."""
        self._mapper, self._last_s = former._mapper, former._last_s

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
            if self._last_s != class_map.captured_s == frame.captured_s == motion.seen.time_s:
                self._last_s = class_map.captured_s
                height_px, width_px = class_map.ids.shape
                self._mapper.look(class_map, frame, camera.resized(width_px, height_px), motion)
                fix = self.read(MARK).value
                if fix is not None and fix.detected:
                    self._mapper.see_mark(fix)
            site_map = self._mapper.map(motion)
        if self._last_s > -math.inf:
            self.write(SITE_MAP, site_map, captured_s=self._last_s)
        return Status.SUCCESS
