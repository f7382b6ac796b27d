"""The landing mark's place on the map."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.registration import Registration
from uav_bt.types import MarkFix, Pose2D
from uav_bt.types.pose import wrap_angle
from uav_bt.types.site_map import MapMark

_STD_M: Final = 0.03  # standard deviation of a near sighting; chosen
_STD_RATIO: Final = 0.05  # in addition, by range; chosen
# In addition, times 1 - confidence. The middle of half an H, cut by the image's border, is 0.25 m
# off.
_DOUBT_M: Final = 0.3
MOVED_VIEWS: Final = 10  # this number of sightings elsewhere in a row moves the mark; chosen
# The mark is moved up to this distance, because the map may have drifted. It is moved further only
# if ground was seen at its former place; otherwise such sightings are mask errors. Chosen.
_DRIFT_M: Final = 0.7


class MarkPlace:
    """Keeps the place of the mark with the smallest standard deviation."""

    def __init__(self) -> None:
        self.mark: MapMark | None = None
        self._elsewhere = 0  # consecutive sightings at other places

    def add(
        self, fix: MarkFix, reckoned: Pose2D, registration: Registration, grid: GroundGrid
    ) -> None:
        """Add a sighting from a dead-reckoned pose, and correct the drone's pose by it."""
        known = self.mark
        std_m = math.hypot(_STD_M, _STD_RATIO * fix.range_m, _DOUBT_M * (1.0 - fix.confidence))
        place = np.array(reckoned.to_world(fix.forward_m, fix.right_m))
        x_m, y_m = registration.correction.to_world(*map(float, place))
        if grid.is_beyond_edge(x_m, y_m):
            return
        moved_m = 0.0 if known is None else known.moved_m
        if known is not None:
            known_m = np.array([known.x_m, known.y_m])
            agrees = registration.correct_by_mark(place, known_m, math.hypot(std_m, known.std_m))
            self._elsewhere = 0 if agrees else self._elsewhere + 1
            x_m, y_m = registration.correction.to_world(*map(float, place))
            apart_m = math.hypot(x_m - known.x_m, y_m - known.y_m)
            gone = apart_m <= _DRIFT_M or grid.shows_ground(known_m, since_s=known.seen_s)
            if self._elsewhere >= MOVED_VIEWS and gone:
                moved_m += apart_m
                known, self._elsewhere = None, 0
            elif not agrees:
                return
        yaw_rad = None if known is None else known.yaw_rad
        if fix.heading_deg is not None:
            drone_rad = registration.correction.yaw_rad + reckoned.yaw_rad
            yaw_rad = wrap_angle(drone_rad - math.radians(fix.heading_deg))
        if known is None or std_m < known.std_m:
            known = MapMark(x_m=x_m, y_m=y_m, std_m=std_m, seen_s=0.0, moved_m=moved_m)
        self.mark = replace(known, seen_s=fix.captured_s, yaw_rad=yaw_rad)
