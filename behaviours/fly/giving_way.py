"""What leaves that steer do when something moves at them: stop, or get out of its way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.path.ways_out import (
    GiveWayConfig,
    WayOut,
    is_of_movers,
    is_threatened,
    runs_into,
    standing_alone,
    way_out,
)
from uav_bt.board import OBSTACLES, ODOMETRY, SITE_MAP
from uav_bt.tree import Port
from uav_bt.types import Velocity
from uav_bt.types.site_map import SiteMap

if TYPE_CHECKING:
    from behaviours.fly.steering import SteeringLeaf

GIVES_WAY: Final = Port(
    "gives_way", bool, default=False, doc="stop for what moves, and get out of its way"
)
# To give way the drone may come a little nearer to what stands than a leg is planned.
_TOUCH_M: Final = 0.38
_EDGE_M: Final = 0.4  # but not to the ground's edge, which it may not see: it flies backwards, too
# Meanwhile it turns to what moves, so that it sees where that goes on to.
_IN_VIEW_RAD: Final = math.radians(12)
_WATCH_PER_S: Final = 1.5
_WATCH_RADPS: Final = 0.8
_STALE_S: Final = 0.8  # a way is flown on for so long without a new view


class GivingWay:
    """Watches what moves on the site map, for one leaf with the port `GIVES_WAY`.

    Args:
        leaf: that moves; its movement and turn are dropped when it gives way.
        config: how the drone gets out of the way.
    """

    def __init__(self, leaf: SteeringLeaf, config: GiveWayConfig | None = None) -> None:
        self._leaf, self._config = leaf, config or GiveWayConfig()
        self._margins = Margins(touch_m=_TOUCH_M, min_start_m=_TOUCH_M, edge_m=_EDGE_M)
        self._decided_s = -math.inf  # on the map of then
        self._way: WayOut | None = None

    @property
    def active(self) -> bool:
        """Whether the drone gives way."""
        return self._way is not None

    def work(self) -> bool:
        """Stop or get out of the way; False when nothing comes too near."""
        leaf = self._leaf
        site_map = leaf.read(SITE_MAP).value if leaf.port_value(GIVES_WAY.name) else None
        if site_map is None or not site_map.movers:
            self._way = None
            return False
        if site_map.captured_s > self._decided_s:
            self._decided_s = site_map.captured_s
            self._way = self._decide(site_map)
        elif self._way is not None and leaf.clock.now() - self._decided_s > _STALE_S:
            self._way = WayOut()  # nothing was seen since: the way may have ended
        if self._way is None:
            return False
        leaf.restart_view()
        leaf.feedback_message = "gives way"
        cos, sin = math.cos(site_map.pose.yaw_rad), math.sin(site_map.pose.yaw_rad)
        x_mps, y_mps = self._way.x_mps, self._way.y_mps
        leaf.propose(
            Velocity(
                forward_mps=cos * x_mps + sin * y_mps,
                right_mps=cos * y_mps - sin * x_mps,
                yaw_rate_radps=self._watching_radps(site_map),
            )
        )
        return True

    def _watching_radps(self, site_map: SiteMap) -> float:
        """Return the turn that keeps the nearest thing that moves in view."""
        places_m = [site_map.pose.to_body(mover.x_m, mover.y_m) for mover in site_map.movers]
        forward_m, right_m = min(places_m, key=lambda place_m: math.hypot(*place_m))
        bearing_rad = math.atan2(right_m, forward_m)
        if abs(bearing_rad) < _IN_VIEW_RAD:
            return 0.0
        return max(-_WATCH_RADPS, min(_WATCH_RADPS, _WATCH_PER_S * bearing_rad))

    def _decide(self, site_map: SiteMap) -> WayOut | None:
        leaf, cfg = self._leaf, self._config
        if is_threatened(site_map, cfg):
            near = recent_obstacles(leaf.read(OBSTACLES).value, site_map)
            standing_m = near.seen_m[~is_of_movers(site_map.movers, near.seen_m)]
            near = replace(near, seen_m=standing_m)
            room = ClearanceMap(standing_alone(site_map), near, self._margins)
            return way_out(room, site_map.movers, cfg, before=self._way)
        motion = leaf.read(ODOMETRY).value
        if motion is None:
            return None
        forward_mps, right_mps = motion.velocity.forward_mps, motion.velocity.right_mps
        cos, sin = math.cos(site_map.pose.yaw_rad), math.sin(site_map.pose.yaw_rad)
        over_ground_mps = np.array(
            [cos * forward_mps - sin * right_mps, sin * forward_mps + cos * right_mps]
        )
        return WayOut() if runs_into(site_map, over_ground_mps, cfg) else None
