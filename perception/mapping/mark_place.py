"""The landing mark's place on the map."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.registration import Registration
from uav_bt.types import MarkFix, Pose2D
from uav_bt.types.pose import wrap_angle
from uav_bt.types.site_map import MapMark


@dataclass(frozen=True, kw_only=True)
class MarkPlaceConfig:
    """Errors of sightings, and when the mark is moved."""

    std_m: float = 0.03  # standard deviation of a near sighting. Chosen.
    std_ratio: float = 0.05  # in addition, by range. Chosen.
    # In addition, times 1 - confidence. The middle of half an H, cut by the image's border, is
    # 0.25 m off.
    doubt_m: float = 0.3
    moved_views: int = 10  # this number of sightings elsewhere in a row moves the mark. Chosen.
    # The mark is moved up to this distance, because the map may have drifted. It is moved further
    # only if ground was seen at its former place; otherwise such sightings are mask errors. Chosen.
    drift_m: float = 0.7


class MarkPlace:
    """Keeps the place of the mark with the smallest standard deviation.

    Args:
        config: errors of sightings.
    """

    def __init__(self, config: MarkPlaceConfig) -> None:
        self._config = config
        self.mark: MapMark | None = None
        self._elsewhere = 0  # consecutive sightings at other places

    def add(
        self, fix: MarkFix, reckoned: Pose2D, registration: Registration, grid: GroundGrid
    ) -> None:
        """Add a sighting, and correct the drone's pose by it.

        Args:
            fix: position from the body's centre.
            reckoned: dead-reckoned pose of the body.
            registration: corrected if the sighting agrees with the map.
            grid: grid of the ground.
        """
        cfg, known = self._config, self.mark
        std_m = math.hypot(
            cfg.std_m, cfg.std_ratio * fix.range_m, cfg.doubt_m * (1.0 - fix.confidence)
        )
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
            gone = apart_m <= cfg.drift_m or grid.shows_ground(
                known.x_m, known.y_m, since_s=known.seen_s
            )
            if self._elsewhere >= cfg.moved_views and gone:
                moved_m += apart_m
                known, self._elsewhere = None, 0
            elif not agrees:
                return
        yaw_rad = None if known is None else known.yaw_rad
        if fix.heading_deg is not None:
            drone_rad = registration.correction.yaw_rad + reckoned.yaw_rad
            yaw_rad = wrap_angle(drone_rad - math.radians(fix.heading_deg))
        if known is None or std_m < known.std_m:
            self.mark = MapMark(
                x_m=x_m,
                y_m=y_m,
                std_m=std_m,
                seen_s=fix.captured_s,
                moved_m=moved_m,
                yaw_rad=yaw_rad,
            )
        else:
            self.mark = replace(known, seen_s=fix.captured_s, yaw_rad=yaw_rad)
