"""Keep away from what is too near: a step back from it, or a push while the drone turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uav_bt.types import ObstaclePoints


@dataclass(frozen=True, kw_only=True)
class KeepAwayConfig:
    """What is too near. Distances are from the body's centre."""

    intrusion_m: float = 0.38  # an obstacle this near is moved away from; half a diagonal is 0.2 m
    room_step_m: float = 0.15  # of that step
    edge_m: float = 0.3  # it does not lead nearer to the carpet's edge
    # While it turns the drone moves away, at the speed below, from obstacles nearer than this and
    # from the carpet's edge, which may be nearer by so much.
    keep_away_m: float = 0.45
    edge_nearer_m: float = 0.15
    keep_away_mps: float = 0.08
    min_range_m: float = 0.05  # nearer points count as so far away: a division needs it


def step_away_m(
    obstacles: ObstaclePoints | None, config: KeepAwayConfig
) -> tuple[float, float] | None:
    """Return a step away from an obstacle that is too near, forward and right.

    Args:
        obstacles: around the drone, in its frame; None while they are not known.
        config: what is too near.

    Returns:
        None when nothing is too near, or when the step would lead nearer to something else.
    """
    if obstacles is None or obstacles.nearest_m >= config.intrusion_m:
        return None
    distances = np.hypot(obstacles.points_m[:, 0], obstacles.points_m[:, 1])
    forward_m, right_m = obstacles.points_m[distances.argmin()]
    away = -config.room_step_m / max(obstacles.nearest_m, config.min_range_m)
    forward_m, right_m = float(away * forward_m), float(away * right_m)
    if not obstacles.allows(forward_m, right_m, margin_m=config.intrusion_m):
        return None
    if (np.linalg.norm(obstacles.edges_m - (forward_m, right_m), axis=1) < config.edge_m).any():
        return None
    return forward_m, right_m


def push_away_mps(obstacles: ObstaclePoints | None, config: KeepAwayConfig) -> tuple[float, float]:
    """Return the velocity away from what is too near, forward and right.

    The nearer a point the more it counts; between two obstacles the drone stays in the middle.

    Args:
        obstacles: around the drone, in its frame; None while they are not known.
        config: what is too near.
    """
    if obstacles is None:
        return 0.0, 0.0
    points_m = np.vstack([obstacles.points_m, obstacles.edges_m])
    ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), config.min_range_m)
    room_m = ranges_m.copy()
    room_m[len(obstacles.points_m) :] += config.edge_nearer_m
    weights = np.clip(config.keep_away_m / room_m - 1.0, 0.0, None)
    if not weights.any():
        return 0.0, 0.0
    forward_mps, right_mps = -config.keep_away_mps * (weights / ranges_m) @ points_m / weights.sum()
    return float(forward_mps), float(right_mps)
