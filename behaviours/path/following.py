"""Route following: heading and speed along a route."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from behaviours.path.clearance import Route
from behaviours.path.margins import Margins
from behaviours.path.movers_ahead import MoversAheadConfig, yielding_mps
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.types import Corridor, Pose2D
from uav_bt.types.site_map import SiteMap

_NEAREST: Final = 2  # cells: nearer cells of a path give no heading, because of their rounding


@dataclass(frozen=True, kw_only=True)
class FollowConfig:
    """How routes are followed: the point steered to, speeds and braking.

    The numbers were chosen in flights on the training scenes.

    Attributes:
        ahead_m: The drone steers to the point of the path at this distance.
        cut_m: A corner is cut if that costs at most this much clearance.
        facing_rad: The drone only turns while its heading error is at least this.
        stop_m: The drone brakes to stop at this distance from an obstacle in the corridor. The
            corridor is wider than a passage beside a box of the map.
        creep_mps: Lowest speed until `near_m`.
        near_m: The drone stops if the corridor is blocked nearer than this.
        past_mps: Speed past that obstacle if it is on the map.
        same_m: An obstacle in the corridor within this distance of one of the map is the same.
        hull_m: The drone stops if the corridor is blocked nearer than this, mapped or not.
        half_width_m: Half of the corridor's width.
        reaction_s: Time from a frame's capture to its effect (measured in the twin).
        brake_mps2: Deceleration that the drone can rely on.
        end_m: Distance from the end of the route at which it counts as flown.
        end_mps: Speed at the end of the route.
        unmapped_s: Age from which recent points that the map lacks are ignored: a lost drone may
            have misplaced them, and they would block a path for ever.
        moving: How movers are predicted.
    """

    ahead_m: float = 0.6
    cut_m: float = 0.03
    facing_rad: float = math.radians(35)
    stop_m: float = 0.45
    creep_mps: float = 0.2
    near_m: float = 0.35
    past_mps: float = 0.15
    same_m: float = 0.2
    hull_m: float = 0.25
    half_width_m: float = 0.5
    reaction_s: float = 0.45
    brake_mps2: float = 0.8
    end_m: float = 0.05
    end_mps: float = 0.1
    unmapped_s: float = 3.0
    moving: MoversAheadConfig = field(default_factory=MoversAheadConfig)


def follow(
    route: Route,
    site_map: SiteMap,
    corridor: Corridor | None = None,
    *,
    margins: Margins | None = None,
    config: FollowConfig | None = None,
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
        config: How the route is followed.
        most_mps: Highest speed.
        reason: One or two words for the status line.

    Returns:
        None when the corridor is blocked right ahead by something that is not on the map.
    """
    margins = route.margins if margins is None else margins.by(site_map.residual_m)
    config = config or FollowConfig()
    bearing_rad, speed_mps = _course(route, site_map.pose, margins, config)
    if abs(bearing_rad) >= config.facing_rad:
        return Rotate(yaw_rad=bearing_rad, reason=reason)
    allowed_mps = _by_corridor(corridor, config)
    if allowed_mps == 0.0 and _is_mapped(corridor, site_map, config):
        allowed_mps = config.past_mps
    speed_mps = min(speed_mps * math.cos(bearing_rad), allowed_mps, most_mps)
    if speed_mps == 0.0:
        return None
    speed_mps = yielding_mps(site_map.movers, route.path_m, speed_mps, config.moving)
    return FollowLeg(
        yaw_rad=bearing_rad, speed_mps=speed_mps, reason=reason if speed_mps > 0.0 else "waits"
    )


def _course(
    route: Route, pose: Pose2D, margins: Margins, config: FollowConfig
) -> tuple[float, float]:
    """Return bearing and speed to the furthest place of the path in a straight line."""
    apart = np.hypot(*(route.path_m - route.path_m[0]).T)
    furthest = int(np.argmax(apart >= config.ahead_m)) or len(route.path_m) - 1
    # A straight line must keep the path's clearance: the drone flies around corners.
    along_m = np.minimum.accumulate(route.clear_m)
    straight = np.flatnonzero(
        route.straight_m[: furthest + 1] >= along_m[: furthest + 1] - config.cut_m
    )
    ahead = max(int(straight[-1]), min(_NEAREST, furthest))
    x_m, y_m = route.path_m[ahead]
    forward_m, right_m = pose.to_body(float(x_m), float(y_m))
    speed = float(margins.speed_mps(route.clear_m[: ahead + 1]).min())
    left_m = float(apart.max())
    braking = math.sqrt(2.0 * config.brake_mps2 * max(left_m - config.end_m, 0.0)) + config.end_mps
    return math.atan2(right_m, forward_m), min(speed, braking)


def _by_corridor(corridor: Corridor | None, config: FollowConfig) -> float:
    """Return the speed from which the drone stops before the end of the free corridor."""
    if corridor is None:
        return math.inf
    free_m = corridor.free_distance_m
    if free_m < config.near_m:
        return 0.0
    lag = config.brake_mps2 * config.reaction_s
    gap_m = max(free_m - config.stop_m, 0.0)
    return max(config.creep_mps, math.sqrt(lag**2 + 2.0 * config.brake_mps2 * gap_m) - lag)


def _is_mapped(corridor: Corridor | None, site_map: SiteMap, config: FollowConfig) -> bool:
    """Return whether the map has an obstacle where the corridor is blocked."""
    if corridor is None or not len(site_map.obstacles_m):
        return False
    if corridor.free_distance_m < config.hull_m:
        return False
    ahead_m, right_m = site_map.pose.points_to_body(site_map.obstacles_m).T
    there = np.abs(ahead_m - corridor.free_distance_m) < config.same_m
    return bool((there & (np.abs(right_m) < config.half_width_m + config.same_m)).any())
