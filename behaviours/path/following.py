"""Fly along a route: where to steer, and how fast."""

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

_NEAREST: Final = 2  # cells: the first two of a path give no course, they turn with its rounding


@dataclass(frozen=True, kw_only=True)
class FollowConfig:
    """Where the drone steers to on a route, and from which speed it can stop.

    The numbers were chosen in flights on the training scenes.

    Attributes:
        ahead_m: The drone steers to the place of the path this far ahead.
        cut_m: It cuts a corner if that costs at most this much clearance.
        facing_rad: It flies on below this error of its heading.
        stop_m: It slows down to stop at this distance from an obstacle in the corridor. The
            corridor is wider than the way past a box whose place the map knows.
        creep_mps: It flies at least at this speed until `near_m`.
        near_m: It stops if the corridor is blocked nearer than this.
        past_mps: It goes on at this speed if the map has that obstacle beside the way.
        same_m: An obstacle in the corridor this near to one of the map is that one.
        hull_m: It stops if the corridor is blocked nearer than this, mapped or not.
        half_width_m: Half of the corridor's width.
        reaction_s: Time from a frame's capture to its effect (measured in the twin).
        brake_mps2: Deceleration that the drone can rely on.
        end_m: The route counts as flown this near to its end.
        end_mps: Speed at its end.
        unmapped_s: Age at which recent points that the map lacks are ignored: a lost drone may have
            misplaced them, and they would close a way for ever.
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

    The drone only turns until it faces the way. It flies slower, or waits, where something that
    moves would come too near.

    Args:
        route: From the drone's place.
        site_map: The map on which it was planned.
        corridor: The safety corridor; None without depth.
        margins: Speeds beside obstacles; None for those of the route.
        config: Where the drone steers to.
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
    """Return bearing and speed to the furthest place of the path that is reached straight."""
    apart = np.hypot(*(route.path_m - route.path_m[0]).T)
    furthest = int(np.argmax(apart >= config.ahead_m)) or len(route.path_m) - 1
    # Around a corner, not across it.
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
