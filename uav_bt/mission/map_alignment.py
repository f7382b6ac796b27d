"""Placement of a mission's map in the world, for reports and displays with the truth.

The map's frame has x along the yaw that the drone reports as 0, y to its right and yaw clockwise;
the world has z up and yaw counter-clockwise. A point of the map is mirrored, turned and moved.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_bt.types import Pose2D, wrap_angle
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import SiteMap

_MIRROR: Final = np.array([1.0, -1.0])
_MEAN_S: Final = 1.0  # s of telemetry over which the turn is averaged, against its noise


@dataclass(frozen=True, kw_only=True)
class MapPlacement:
    """Placement of a map in the world."""

    frame: Pose2D  # the map's origin, and its x axis counter-clockwise from the world's

    def to_world(self, points_m: Floats) -> Floats:
        """Return points of the map, (N, 2) metres, in the world."""
        return self.frame.points_to_world(points_m * _MIRROR)

    def pose_to_world(self, pose: Pose2D) -> Pose2D:
        """Return a pose in the map as one in the world."""
        x_m, y_m = self.frame.to_world(pose.x_m, -pose.y_m)
        yaw_rad = wrap_angle(self.frame.yaw_rad - pose.yaw_rad)
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


class MapAlignment:
    """Aligns a map with the world by the drone's pose in both when the map began."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._x_axis = complex(0.0)  # of the map in the world: the sum of its directions
        self._began: tuple[Pose2D, Pose2D] | None = None  # the drone's pose in map and world
        self._restarts = 0

    def add(
        self, time_s: float, pose: Pose2D, reported_yaw_rad: float, site_map: SiteMap | None
    ) -> None:
        """Add a tick, beginning with the flight's first.

        Args:
            time_s: of the mission clock.
            pose: of the drone in the world in that tick.
            reported_yaw_rad: yaw of its telemetry, clockwise.
            site_map: the mission's map in that tick, None before it has one.
        """
        if self._first_s is None:
            self._first_s = time_s
        if time_s - self._first_s <= _MEAN_S:
            # The reported yaw is the drone's turn from the map's x axis, clockwise.
            self._x_axis += cmath.rect(1.0, pose.yaw_rad + reported_yaw_rad)
        if site_map is None:
            return
        if self._began is None or site_map.restarts > self._restarts:
            self._began, self._restarts = (site_map.pose, pose), site_map.restarts

    @property
    def placement(self) -> MapPlacement | None:
        """Placement of the map; None before there is a map."""
        if self._began is None:
            return None
        believed, true = self._began
        x_axis = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=cmath.phase(self._x_axis))
        x_m, y_m = x_axis.to_world(believed.x_m, -believed.y_m)
        return MapPlacement(
            frame=Pose2D(x_m=true.x_m - x_m, y_m=true.y_m - y_m, yaw_rad=x_axis.yaw_rad)
        )
