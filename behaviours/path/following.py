"""Route following: heading and speed along a route.

The numbers were chosen in flights on the training scenes unless their line states otherwise.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviours.path.clearance import Route
from behaviours.path.margins import Margins
from behaviours.path.movers import yielding_mps
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.types import Corridor, Pose2D
from uav_bt.types.site_map import SiteMap

UNMAPPED_S: Final = 3.0
"""Age from which planning ignores recent points that the map lacks, s: a lost drone may have
misplaced them, and they would block a path for ever."""

_NEAREST_M: Final = 0.19  # m; nearer cells of a path give no heading, because of their rounding
_AHEAD_M: Final = 0.6  # m; the drone steers to the point of the path at this distance
_CUT_M: Final = 0.03  # m; a corner is cut if that costs at most this much clearance
_FACING_RAD: Final = math.radians(35)  # the drone only turns while its heading error is this large
_STOP_M: Final = 0.45  # m; the drone brakes to stop at this distance from an obstacle in the
# corridor, which is wider than a passage beside a box of the map
_CREEP_MPS: Final = 0.2  # m/s; lowest speed until `_NEAR_M`
_NEAR_M: Final = 0.35  # m; the drone stops if the corridor is blocked nearer than this
_PAST_MPS: Final = 0.15  # m/s; past that obstacle if it is on the map
_SAME_M: Final = 0.2  # m; an obstacle in the corridor this near to one of the map is the same
_HULL_M: Final = (
    0.25  # m; the drone stops if the corridor is blocked nearer than this, mapped or not
)
_HALF_WIDTH_M: Final = 0.5  # m; half of the corridor's width
_REACTION_S: Final = 0.45  # s; from a frame's capture to its effect (measured in the twin)
_BRAKE_MPS2: Final = 0.8  # m/s2; deceleration that the drone can rely on
_END_M: Final = 0.05  # m; distance from the end of the route at which it counts as flown
_END_MPS: Final = 0.1  # m/s; speed at the end of the route


def follow(
    route: Route,
    site_map: SiteMap,
    corridor: Corridor | None = None,
    *,
    margins: Margins | None = None,
    most_mps: float = math.inf,
    reason: str = "",
) -> FollowLeg | Rotate | None:
    """Return the heading and the speed to fly along a route.

    The drone only turns until it faces the path. It slows down or waits where a mover would come
    too near.

    Args:
        route: Route from the drone's place.
        site_map: The map on which the route was planned.
        corridor: The safety corridor; None without depth.
        margins: Margins that set the speed beside obstacles; default: those of the route.
        most_mps: Highest speed.
        reason: One or two words for the status line.

    Returns:
        None when the corridor is blocked right ahead by something that is not on the map.
    """
    margins = route.margins if margins is None else margins.by(site_map.residual_m)
    bearing_rad, speed_mps = _course(route, site_map.pose, margins)
    if abs(bearing_rad) >= _FACING_RAD:
        return Rotate(yaw_rad=bearing_rad, reason=reason)
    allowed_mps = _by_corridor(corridor)
    if allowed_mps == 0.0 and _is_mapped(corridor, site_map):
        allowed_mps = _PAST_MPS
    speed_mps = min(speed_mps * math.cos(bearing_rad), allowed_mps, most_mps)
    if speed_mps == 0.0:
        return None
    speed_mps = yielding_mps(site_map.movers, route.path_m, speed_mps)
    return FollowLeg(
        yaw_rad=bearing_rad, speed_mps=speed_mps, reason=reason if speed_mps > 0.0 else "waits"
    )


def _course(route: Route, pose: Pose2D, margins: Margins) -> tuple[float, float]:
    """Return bearing and speed to the furthest place of the path in a straight line."""
    apart = np.hypot(*(route.path_m - route.path_m[0]).T)
    furthest = int(np.argmax(apart >= _AHEAD_M)) or len(route.path_m) - 1
    # A straight line must keep the path's clearance: the drone flies around corners.
    along_m = np.minimum.accumulate(route.clear_m)
    straight = np.flatnonzero(route.straight_m[: furthest + 1] >= along_m[: furthest + 1] - _CUT_M)
    ahead = max(int(straight[-1]), min(int(np.argmax(apart >= _NEAREST_M)) or furthest, furthest))
    x_m, y_m = route.path_m[ahead]
    forward_m, right_m = pose.to_body(float(x_m), float(y_m))
    speed = float(margins.speed_mps(route.clear_m[: ahead + 1]).min())
    left_m = max(float(apart.max()) - _END_M, 0.0)
    return math.atan2(right_m, forward_m), min(
        speed, math.sqrt(2.0 * _BRAKE_MPS2 * left_m) + _END_MPS
    )


def _by_corridor(corridor: Corridor | None) -> float:
    """Return the speed from which the drone stops before the end of the free corridor."""
    if corridor is None:
        return math.inf
    if corridor.free_distance_m < _NEAR_M:
        return 0.0
    lag = _BRAKE_MPS2 * _REACTION_S
    gap_m = max(corridor.free_distance_m - _STOP_M, 0.0)
    return max(_CREEP_MPS, math.sqrt(lag**2 + 2.0 * _BRAKE_MPS2 * gap_m) - lag)


def _is_mapped(corridor: Corridor | None, site_map: SiteMap) -> bool:
    """Return whether the map has an obstacle where the corridor is blocked."""
    if corridor is None or not len(site_map.obstacles_m) or corridor.free_distance_m < _HULL_M:
        return False
    ahead_m, right_m = site_map.pose.points_to_body(site_map.obstacles_m).T
    there = np.abs(ahead_m - corridor.free_distance_m) < _SAME_M
    return bool((there & (np.abs(right_m) < _HALF_WIDTH_M + _SAME_M)).any())
