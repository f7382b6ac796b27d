"""Distance keeping from obstacles and edges: a step away, or a push while the drone moves.

Distances are metres from the body's centre. Half of the body's diagonal is 0.2 m. The numbers were
chosen in flights on the training scenes.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviours.path.nearby import recent_obstacles
from uav_bt.types import NearObstacles
from uav_bt.types.site_map import SiteMap

_INTRUSION_M: Final = 0.38  # the drone steps away from an obstacle nearer than this
ROOM_STEP_M: Final = 0.15  # length of that step
# While it turns or flies on, the drone is pushed away from obstacles nearer than this. The push
# grows as the distance shrinks.
KEEP_AWAY_M: Final = 0.45
_EDGE_NEARER_M: Final = 0.15  # the edge of the ground may be nearer than an obstacle by this
PUSH_PER_S: Final = 1.5  # speed of the push per metre of intrusion
PUSH_MPS: Final = 0.2  # highest speed of the push
_ALIKE_M: Final = 0.25  # points within this distance of each other belong to one obstacle
_OUTLINE_M: Final = 0.1  # between the points on the sides of an object
_MIN_RANGE_M: Final = 0.05  # smaller ranges count as this, to avoid a division by zero


def by_the_map(obstacles: NearObstacles | None, site_map: SiteMap | None) -> NearObstacles | None:
    """Return the obstacles near the drone, placed by the map if it has them.

    Recent points are placed by dead reckoning and drift. The map is matched to every view. One that
    views contradict is not used.
    """
    if obstacles is None or site_map is None or site_map.contradicted_s > 0.0:
        return obstacles
    # Of most objects only one or two sides were seen. The outline adds the others; without them
    # the push could lead into them.
    pose = site_map.pose
    outlines = [
        item.outline_m(_OUTLINE_M)
        for item in site_map.objects
        if math.hypot(item.x_m - pose.x_m, item.y_m - pose.y_m)
        <= KEEP_AWAY_M + math.hypot(item.size_m, item.width_m)
    ]
    lately = recent_obstacles(obstacles.within(KEEP_AWAY_M + _ALIKE_M), site_map)
    points_m = np.vstack([site_map.obstacles_m, *outlines, lately.seen_m])
    edges_m = np.vstack([site_map.edges_m, lately.edges_m])
    return NearObstacles(
        points_m=pose.points_to_body(points_m),
        edges_m=pose.points_to_body(edges_m),
        captured_s=obstacles.captured_s,
    ).within(KEEP_AWAY_M)


def step_away_m(obstacles: NearObstacles | None, edge_m: float) -> tuple[float, float] | None:
    """Return a step away from an obstacle that is too near, forward and right, metres.

    None if nothing is too near, or if the step would lead too near to something else, or end nearer
    than `edge_m` to the edge of the ground.
    """
    if obstacles is None or obstacles.nearest_m >= _INTRUSION_M:
        return None
    distances = np.hypot(obstacles.points_m[:, 0], obstacles.points_m[:, 1])
    forward_m, right_m = obstacles.points_m[distances.argmin()]
    away = -ROOM_STEP_M / max(obstacles.nearest_m, _MIN_RANGE_M)
    forward_m, right_m = float(away * forward_m), float(away * right_m)
    if not obstacles.allows(forward_m, right_m, margin_m=_INTRUSION_M):
        return None
    if (np.linalg.norm(obstacles.edges_m - (forward_m, right_m), axis=1) < edge_m).any():
        return None
    return forward_m, right_m


def push_away_mps(obstacles: NearObstacles | None) -> tuple[float, float]:
    """Return the velocity away from obstacles that are too near, forward and right, m/s.

    Nearer points weigh more. Between two obstacles the drone stays in the middle.
    """
    if obstacles is None:
        return 0.0, 0.0
    points_m = np.vstack([obstacles.points_m, obstacles.edges_m])
    ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), _MIN_RANGE_M)
    gap_m = ranges_m.copy()
    gap_m[len(obstacles.points_m) :] += _EDGE_NEARER_M
    weights = np.clip(KEEP_AWAY_M / gap_m - 1.0, 0.0, None)
    if not weights.any():
        return 0.0, 0.0
    speed_mps = min(PUSH_PER_S * (KEEP_AWAY_M - float(gap_m.min())), PUSH_MPS)
    forward_mps, right_mps = -speed_mps * (weights / ranges_m) @ points_m / weights.sum()
    return float(forward_mps), float(right_mps)
