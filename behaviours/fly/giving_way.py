"""Giving way to movers: stop or get out of their way, and keep the nearest one in view."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.path.ways_out import (
    WayOut,
    WayOutConfig,
    is_of_movers,
    is_threatened,
    runs_into,
    standing_alone,
    way_out,
)
from uav_bt.types import NearObstacles, Velocity, rotate, rotate_points
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import SiteMap

_MIN_BEARINGS: Final = 2  # fewer are specks of the class map


@dataclass(frozen=True, kw_only=True)
class GivingWayConfig:
    """How the drone gives way. The numbers were chosen in flights among movers in the twin.

    Attributes:
        way_out: Parameters of the search for ways out.
        margins: Distances from static obstacles and edges. Obstacles may be slightly nearer than on
            a route. Edges may not: the drone also flies backwards and sideways, where an edge may
            be out of view.
        in_view_rad: A mover within this bearing counts as in view.
        watch_per_s: Yaw rate per radian of that bearing.
        watch_radps: Highest yaw rate.
        stale_s: The drone stops when there was no new view for this time.
        lost_s: A mover that was not seen for this time may be an obstacle whose base is below the
            view.
        hidden_m: Assumed range of such an obstacle; nearer bases are below the view of a camera
            that looks 30 degrees down from 1.5 m.
        hidden_rad: Half angle ahead in which such obstacles count.
        above_m: Height above the flight height that the drone climbs to. People and carts may pass
            below; the limit of the ceiling holds.
        climb_per_s: Climb rate per metre of error in that height.
        climb_mps: Highest climb rate.
    """

    way_out: WayOutConfig = field(default_factory=WayOutConfig)
    margins: Margins = field(
        default_factory=lambda: Margins(touch_m=0.38, min_start_m=0.38, edge_m=0.4)
    )
    in_view_rad: float = math.radians(12)
    watch_per_s: float = 1.5
    watch_radps: float = 1.2
    stale_s: float = 0.8
    lost_s: float = 0.5
    hidden_m: float = 0.9
    hidden_rad: float = math.radians(60)
    above_m: float = 0.5
    climb_per_s: float = 2.0
    climb_mps: float = 0.5


class GivingWay:
    """Decides on each new map whether the drone gives way, and in which direction.

    Args:
        config: How the drone gives way.
    """

    def __init__(self, config: GivingWayConfig | None = None) -> None:
        self.config = config or GivingWayConfig()
        self._decided_s = -math.inf  # capture time of the map of the last decision
        self._way: WayOut | None = None

    def velocity(
        self,
        site_map: SiteMap | None,
        obstacles: NearObstacles | None,
        motion: MotionEstimate | None,
        *,
        now_s: float,
    ) -> Velocity | None:
        """Return the velocity that gives way, in the body frame; None when nothing comes too near.

        Args:
            site_map: The newest map; None without one.
            obstacles: Obstacles seen around the drone.
            motion: The drone's motion over the ground.
            now_s: Time of the mission clock.
        """
        if site_map is None or not site_map.movers:
            self._way = None
            return None
        site_map = self._with_hidden(site_map, obstacles)
        stale = now_s - self._decided_s > self.config.stale_s
        if site_map.captured_s > self._decided_s:
            before = None if stale else self._way  # an older way is not being flown
            self._decided_s = site_map.captured_s
            self._way = self._decide(site_map, obstacles, motion, before)
        elif stale and (self._way is not None or is_threatened(site_map, self.config.way_out)):
            self._way = WayOut()  # the way may end where no new view has shown it
        if self._way is None:
            return None
        over_ground_mps = np.array([[self._way.x_mps, self._way.y_mps]])
        ((forward_mps, right_mps),) = rotate_points(over_ground_mps, -site_map.pose.yaw_rad)
        return Velocity(
            forward_mps=float(forward_mps),
            right_mps=float(right_mps),
            yaw_rate_radps=self._watching_radps(site_map),
        )

    def raised_m(self, site_map: SiteMap | None) -> float:
        """Return the height above the flight height that the drone keeps, metres.

        It keeps it from the first seen movement to the landing, because a mover that is out of view
        may come back from any side.

        Args:
            site_map: The newest map; None without one.
        """
        moves = site_map is not None and (bool(site_map.movers) or math.isfinite(site_map.moved_s))
        return self.config.above_m if moves else 0.0

    def _with_hidden(self, site_map: SiteMap, obstacles: NearObstacles | None) -> SiteMap:
        """Return the map with lost movers at an obstacle whose base is below the view.

        They are assumed to come towards the drone, which a step to the side evades.
        """
        cfg = self.config
        if obstacles is None or obstacles.unplaced_within(cfg.hidden_rad) < _MIN_BEARINGS:
            return site_map
        ahead_rad = obstacles.unplaced_rad[np.abs(obstacles.unplaced_rad) < cfg.hidden_rad]
        bearing_rad = float(np.median(ahead_rad))
        pose = site_map.pose
        ux, uy = rotate(math.cos(bearing_rad), math.sin(bearing_rad), pose.yaw_rad)
        return replace(
            site_map,
            movers=tuple(
                replace(
                    mover,
                    x_m=pose.x_m + cfg.hidden_m * ux,
                    y_m=pose.y_m + cfg.hidden_m * uy,
                    x_mps=-mover.std_mps * ux,
                    y_mps=-mover.std_mps * uy,
                    std_m=0.0,
                    std_mps=0.0,
                )
                if site_map.captured_s - mover.seen_s > cfg.lost_s
                else mover
                for mover in site_map.movers
            ),
        )

    def _watching_radps(self, site_map: SiteMap) -> float:
        """Return the yaw rate that keeps the nearest mover in view."""
        cfg = self.config
        places_m = [site_map.pose.to_body(mover.x_m, mover.y_m) for mover in site_map.movers]
        forward_m, right_m = min(places_m, key=lambda place_m: math.hypot(*place_m))
        bearing_rad = math.atan2(right_m, forward_m)
        if abs(bearing_rad) < cfg.in_view_rad:
            return 0.0
        return max(-cfg.watch_radps, min(cfg.watch_radps, cfg.watch_per_s * bearing_rad))

    def _decide(
        self,
        site_map: SiteMap,
        obstacles: NearObstacles | None,
        motion: MotionEstimate | None,
        before: WayOut | None,
    ) -> WayOut | None:
        cfg = self.config
        if is_threatened(site_map, cfg.way_out):
            recent = recent_obstacles(obstacles, site_map)
            standing_m = recent.seen_m[~is_of_movers(site_map.movers, recent.seen_m)]
            recent = replace(recent, seen_m=standing_m)
            clearance = ClearanceMap(standing_alone(site_map), recent, cfg.margins)
            return way_out(clearance, site_map.movers, cfg.way_out, before=before)
        if motion is None:
            return None
        body_mps = np.array([[motion.velocity.forward_mps, motion.velocity.right_mps]])
        (over_ground_mps,) = rotate_points(body_mps, site_map.pose.yaw_rad)
        return WayOut() if runs_into(site_map, over_ground_mps, cfg.way_out) else None
