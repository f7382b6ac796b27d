"""The drone's place by odometry and site map: relative to the take-off pose, the area, the mark."""

from __future__ import annotations

import math

from uav_bt.board import MARK, ODOMETRY, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.mission.judge import Belief
from uav_bt.types import Pose2D, wrap_angle
from uav_bt.types.area import Area
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import SiteMap


class Whereabouts:
    """Follows the drone from its take-off pose.

    The take-off pose is the first pose of the odometry, or that of the site map once there is one.
    The map's last correction of the drift is kept while the map is stale.

    Args:
        board: The mission's board.
        area: The area of the mission; None: no bound.
    """

    def __init__(self, board: Blackboard, area: Area | None = None) -> None:
        self._board = board
        self.area = area
        self.place: Pose2D | None = None  # of the last update; None where it is unknown
        self.site_map: SiteMap | None = None  # the newest one, which may be stale
        self._start: Pose2D | None = None

    def update(self) -> Pose2D | None:
        """Return the present pose: metres ahead and to the right, heading clockwise, or None."""
        motion, site_map = self._board.value(ODOMETRY), self._board.value(SITE_MAP)
        if site_map is not None:
            self.site_map, self._start = site_map, site_map.start
        self.place = None if motion is None else self._relative(motion)
        return self.place

    def _relative(self, motion: MotionEstimate) -> Pose2D:
        here: Pose2D = motion.pose
        if self._start is None:
            self._start = here
        if self.site_map is not None:
            here = self.site_map.correction.pose_to_world(here)
        x_m, y_m = self._start.to_body(here.x_m, here.y_m)
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=wrap_angle(here.yaw_rad - self._start.yaw_rad))

    @property
    def area_margin_m(self) -> float | None:
        """Distance to the area's boundary, negative outside; None without area or place."""
        if self.area is None or self.place is None:
            return None
        return self.area.margin_m(self.place.x_m, self.place.y_m)

    def belief(self) -> Belief:
        """Return the distances to mark and boundary, for the judge."""
        return Belief(mark_m=self._mark_m(), area_margin_m=self.area_margin_m)

    def _mark_m(self) -> float | None:
        """Return the distance of the landing mark, by its track or else by the fresh map."""
        fix = self._board.value(MARK)
        if fix is not None:
            return fix.range_m
        site_map = self._board.value(SITE_MAP)
        if site_map is None or site_map.mark is None:
            return None
        mark, pose = site_map.mark, site_map.pose
        return math.hypot(mark.x_m - pose.x_m, mark.y_m - pose.y_m)
