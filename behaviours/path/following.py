"""Fly along a leg of the map: where to steer, and how fast."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from behaviours.path.movers_ahead import MoversAheadConfig, yielding_mps
from behaviours.path.clearance import Floats, RecentObstacles, Route, Margins
from uav_bt.protocols import Decision
from uav_bt.types import Corridor, ObstaclePoints, Pose2D
from uav_bt.types.site_map import SiteMap

_NEAREST: Final = 2  # cells ahead: nearer ones give no course


@dataclass(frozen=True, kw_only=True)
class FollowConfig:
    """When the drone flies on, and from which speed it can stop."""

    ahead_m: float = 0.6  # on the path: where the drone steers to,
    cut_m: float = 0.03  # where the straight line there comes hardly nearer to things than the path
    facing_rad: float = math.radians(35)  # it flies on below this error of its heading
    # The corridor is wider than the way past a box whose place the map knows: what it shows ahead
    # slows the drone down, and stops it only so near.
    stop_m: float = 0.45
    creep_mps: float = 0.2
    near_m: float = 0.35
    past_mps: float = 0.15  # nearer, past what the map has there beside the way,
    same_m: float = 0.2  # within so much of where the corridor shows it,
    hull_m: float = 0.25  # but never nearer than this
    half_width_m: float = 0.5  # of the corridor
    reaction_s: float = 0.45  # from a frame to its effect
    brake_mps2: float = 0.8
    # What was seen so long ago, on the map's ground, and is not on the map since bars no way: seen
    # from where a drone that had lost the ground believed to be, it would bar one for ever.
    unmapped_s: float = 3.0
    moving: MoversAheadConfig = field(default_factory=MoversAheadConfig)


def around(
    obstacles: ObstaclePoints | None,
    site_map: SiteMap,
    *,
    same_m: float = 0.25,
    least: int = 3,
    unmapped_s: float = math.inf,
) -> RecentObstacles:
    """Return what was seen lately around the drone and is not on the map.

    The map places what stands by many views, and corrects the drone's drift; what was seen lately
    is placed by a few, and has drifted since.

    Args:
        obstacles: around the drone, in its frame; None while they are not known.
        site_map: as it is known now.
        same_m: what the map shows so near to a point is that point.
        least: fewer points of obstacles so near to each other are a network's error.
        unmapped_s: what was seen last so long ago, on ground that the map has seen and without
            being on the map since, does not count.
    """
    if obstacles is None:
        return RecentObstacles()
    to_map = site_map.pose.points_to_world
    points_m = _believed(site_map, to_map(obstacles.points_m), obstacles.points_age_s, unmapped_s)
    edges_m = _believed(site_map, to_map(obstacles.edges_m), obstacles.edges_age_s, unmapped_s)
    new_m = _far_from(site_map.obstacles_m, points_m, same_m)
    alike = np.linalg.norm(new_m[:, None] - new_m, axis=-1) < same_m
    return RecentObstacles(
        seen_m=new_m[alike.sum(axis=1) >= least],
        assumed_m=to_map(obstacles.assumed_m),
        edges_m=_far_from(site_map.edges_m, edges_m, same_m),
    )


def _believed(site_map: SiteMap, places_m: Floats, age_s: Floats, unmapped_s: float) -> Floats:
    """Return the places that were seen lately, or are not on ground that the map has seen."""
    if not len(age_s):
        return places_m
    return places_m[(age_s <= unmapped_s) | ~site_map.lies_on(site_map.ground, places_m)]


def _far_from(known_m: Floats, points_m: Floats, near_m: float) -> Floats:
    """Return the points that have none of the known ones so near."""
    if not len(points_m):
        return points_m
    from scipy.spatial import cKDTree  # noqa: PLC0415  (`uav-bt check` must answer at once)

    nearest_m, _ = cKDTree(known_m).query(points_m, distance_upper_bound=near_m)
    return np.asarray(points_m[nearest_m >= near_m])


def follow(
    leg: Route,
    site_map: SiteMap,
    corridor: Corridor | None,
    *,
    margins: Margins,
    config: FollowConfig,
    reason: str = "",
) -> Decision | None:
    """Return heading and speed along a leg; the drone only turns until it faces the way.

    It flies slower, or waits, where something that moves would come too near.

    Args:
        leg: from where the drone is.
        site_map: on which the leg was planned.
        corridor: what it shows ahead; None where there is no depth, or none of late.
        margins: how fast legs are flown beside things.
        config: how they are followed.
        reason: for the status line.

    Returns:
        None when the corridor is blocked right ahead by something that is not on the map.
    """
    bearing_rad, speed_mps = _course(leg, site_map.pose, margins, config)
    facing = abs(bearing_rad) < config.facing_rad
    if facing:
        allowed_mps = _by_corridor(corridor, config)
        if allowed_mps == 0.0 and _is_mapped(corridor, site_map, config):
            allowed_mps = config.past_mps
        speed_mps = min(speed_mps * math.cos(bearing_rad), allowed_mps)
        if speed_mps == 0.0:
            return None
        speed_mps = yielding_mps(site_map.movers, leg.path_m, speed_mps, config.moving)
        reason = reason if speed_mps > 0.0 else "waits"
    return Decision(
        forward_m=max(float(np.hypot(*(leg.path_m[-1] - leg.path_m[0]))), 0.1),
        yaw_rad=bearing_rad,
        speed_mps=speed_mps if facing else 0.0,
        reason=reason,
    )


def _course(leg: Route, pose: Pose2D, margins: Margins, config: FollowConfig) -> tuple[float, float]:
    """Return bearing and speed to the furthest place of the path that is reached straight."""
    apart = np.hypot(*(leg.path_m - leg.path_m[0]).T)
    furthest = int(np.argmax(apart >= config.ahead_m)) or len(leg.path_m) - 1
    # Around a corner, not across it.
    along_m = np.minimum.accumulate(leg.clear_m)
    straight = np.flatnonzero(
        leg.straight_m[: furthest + 1] >= along_m[: furthest + 1] - config.cut_m
    )
    ahead = max(int(straight[-1]), min(_NEAREST, furthest))
    x_m, y_m = leg.path_m[ahead]
    forward_m, right_m = pose.to_body(float(x_m), float(y_m))
    speed = float(margins.speed_mps(leg.clear_m[: ahead + 1]).min())
    left_m = float(apart.max())
    braking = math.sqrt(2.0 * config.brake_mps2 * max(left_m - 0.05, 0.0)) + 0.1
    return math.atan2(right_m, forward_m), min(speed, braking)


def _by_corridor(corridor: Corridor | None, config: FollowConfig) -> float:
    """Return the speed from which the drone stops before what the corridor shows."""
    if corridor is None:
        return math.inf
    free_m = corridor.free_distance_m
    if free_m < config.near_m:
        return 0.0
    lag = config.brake_mps2 * config.reaction_s
    gap_m = max(free_m - config.stop_m, 0.0)
    return max(config.creep_mps, math.sqrt(lag**2 + 2.0 * config.brake_mps2 * gap_m) - lag)


def _is_mapped(corridor: Corridor | None, site_map: SiteMap, config: FollowConfig) -> bool:
    """Return whether the map has an obstacle where the corridor is blocked: the leg leads past."""
    if corridor is None or not len(site_map.obstacles_m):
        return False
    if corridor.free_distance_m < config.hull_m:
        return False
    ahead_m, right_m = site_map.pose.points_to_body(site_map.obstacles_m).T
    there = np.abs(ahead_m - corridor.free_distance_m) < config.same_m
    return bool((there & (np.abs(right_m) < config.half_width_m + config.same_m)).any())
