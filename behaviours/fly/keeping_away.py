"""Distance keeping from obstacles and edges: a step away, or a push while the drone moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from behaviours.path.nearby import recent_obstacles
from uav_bt.types import NearObstacles, Pose2D
from uav_bt.types.site_map import MapObject, SiteMap


@dataclass(frozen=True, kw_only=True)
class KeepAwayConfig:
    """Distances from the body's centre at which the drone moves away.

    Half of the body's diagonal is 0.2 m. The numbers were chosen in flights on the training scenes.

    Attributes:
        intrusion_m: The drone steps away from an obstacle nearer than this.
        room_step_m: Length of that step.
        keep_away_m: While it turns or flies on, the drone is pushed away from obstacles nearer than
            this. The push grows as the distance shrinks.
        edge_nearer_m: The edge of the ground may be nearer than an obstacle by this.
        keep_away_per_s: Speed of the push per metre of intrusion.
        keep_away_mps: Highest speed of the push.
        alike_m: Points within this distance of each other belong to one obstacle.
        outline_m: Distance between the points on the sides of an object.
        min_range_m: Smaller ranges count as this, to avoid a division by zero.
    """

    intrusion_m: float = 0.38
    room_step_m: float = 0.15
    keep_away_m: float = 0.45
    edge_nearer_m: float = 0.15
    keep_away_per_s: float = 1.5
    keep_away_mps: float = 0.2
    alike_m: float = 0.25
    outline_m: float = 0.1
    min_range_m: float = 0.05


def by_the_map(
    obstacles: NearObstacles | None, site_map: SiteMap | None, config: KeepAwayConfig
) -> NearObstacles | None:
    """Return the obstacles near the drone, placed by the map if it has them.

    Recent points are placed by dead reckoning and drift. The map is matched to every view.

    Args:
        obstacles: Obstacles around the drone, in the body frame; None while unknown.
        site_map: The newest map; None without one. A map that views contradict is not used.
        config: Distances.
    """
    if obstacles is None or site_map is None or site_map.contradicted_s > 0.0:
        return obstacles

    # Of most objects only one or two sides were seen. The outline adds the others; without them
    # the push could lead into them.
    outlines = [
        each.outline_m(config.outline_m)
        for each in site_map.objects
        if _may_reach(each, site_map.pose, config.keep_away_m)
    ]
    seen = obstacles.within(config.keep_away_m + config.alike_m)
    lately, to_body = recent_obstacles(seen, site_map), site_map.pose.points_to_body
    found = NearObstacles(
        points_m=to_body(np.vstack([site_map.obstacles_m, *outlines, lately.seen_m])),
        edges_m=to_body(np.vstack([site_map.edges_m, lately.edges_m])),
        captured_s=obstacles.captured_s,
    )
    return found.within(config.keep_away_m)


def _may_reach(item: MapObject, pose: Pose2D, reach_m: float) -> bool:
    """Return whether the base of an object may lie within a distance of the body's centre."""
    apart_m = math.hypot(item.x_m - pose.x_m, item.y_m - pose.y_m)
    return apart_m <= reach_m + math.hypot(item.size_m, item.width_m)


def step_away_m(
    obstacles: NearObstacles | None, config: KeepAwayConfig, edge_m: float
) -> tuple[float, float] | None:
    """Return a step away from an obstacle that is too near, forward and right, metres.

    Args:
        obstacles: Obstacles around the drone, in the body frame; None while unknown.
        config: Distances.
        edge_m: Least distance of the step's end from the edge of the ground.

    Returns:
        None if nothing is too near, or if the step would lead too near to something else.
    """
    if obstacles is None or obstacles.nearest_m >= config.intrusion_m:
        return None
    distances = np.hypot(obstacles.points_m[:, 0], obstacles.points_m[:, 1])
    forward_m, right_m = obstacles.points_m[distances.argmin()]
    away = -config.room_step_m / max(obstacles.nearest_m, config.min_range_m)
    forward_m, right_m = float(away * forward_m), float(away * right_m)
    if not obstacles.allows(forward_m, right_m, margin_m=config.intrusion_m):
        return None
    if (np.linalg.norm(obstacles.edges_m - (forward_m, right_m), axis=1) < edge_m).any():
        return None
    return forward_m, right_m


def push_away_mps(obstacles: NearObstacles | None, config: KeepAwayConfig) -> tuple[float, float]:
    """Return the velocity away from obstacles that are too near, forward and right, m/s.

    Nearer points weigh more. Between two obstacles the drone stays in the middle.

    Args:
        obstacles: Obstacles around the drone, in the body frame; None while unknown.
        config: Distances.
    """
    if obstacles is None:
        return 0.0, 0.0
    points_m = np.vstack([obstacles.points_m, obstacles.edges_m])
    ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), config.min_range_m)
    gap_m = ranges_m.copy()
    gap_m[len(obstacles.points_m) :] += config.edge_nearer_m
    weights = np.clip(config.keep_away_m / gap_m - 1.0, 0.0, None)
    if not weights.any():
        return 0.0, 0.0
    intrusion_m = config.keep_away_m - float(gap_m.min())
    speed_mps = min(config.keep_away_per_s * intrusion_m, config.keep_away_mps)
    forward_mps, right_mps = -speed_mps * (weights / ranges_m) @ points_m / weights.sum()
    return float(forward_mps), float(right_mps)
