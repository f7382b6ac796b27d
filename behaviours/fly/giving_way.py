"""What leaves that steer do when something moves at them: stop, or get out of its way."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from behaviours.path.following import around
from behaviours.path.giving_way import GiveWayConfig, Way, is_threatened, runs_into, way_out
from behaviours.path.survey import Room, SurveyConfig
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


class GivingWay:
    """Watches what moves on the site map, for one leaf with the port `GIVES_WAY`.

    Args:
        leaf: that moves; its movement and turn are dropped when it gives way.
        config: how the drone gets out of the way.
    """

    def __init__(self, leaf: SteeringLeaf, config: GiveWayConfig | None = None) -> None:
        self._leaf, self._config = leaf, config or GiveWayConfig()
        self._survey = SurveyConfig(touch_m=_TOUCH_M)
        self._decided_s = -math.inf  # on the map of then
        self._way: Way | None = None

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
        if self._way is None:
            return False
        leaf.restart_view()
        leaf.feedback_message = "gives way"
        cos, sin = math.cos(site_map.pose.yaw_rad), math.sin(site_map.pose.yaw_rad)
        x_mps, y_mps = self._way.x_mps, self._way.y_mps
        leaf.propose(
            Velocity(forward_mps=cos * x_mps + sin * y_mps, right_mps=cos * y_mps - sin * x_mps)
        )
        return True

    def _decide(self, site_map: SiteMap) -> Way | None:
        leaf, cfg = self._leaf, self._config
        if is_threatened(site_map, cfg):
            near = around(leaf.read(OBSTACLES).value, site_map)
            return way_out(Room(site_map, near, config=self._survey), cfg, before=self._way)
        motion = leaf.read(ODOMETRY).value
        if motion is None:
            return None
        forward_mps, right_mps = motion.velocity.forward_mps, motion.velocity.right_mps
        cos, sin = math.cos(site_map.pose.yaw_rad), math.sin(site_map.pose.yaw_rad)
        over_ground_mps = np.array(
            [cos * forward_mps - sin * right_mps, sin * forward_mps + cos * right_mps]
        )
        return Way() if runs_into(site_map, over_ground_mps, cfg) else None
