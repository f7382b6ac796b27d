"""Recently seen obstacles around the drone that are not on the site map."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uav_bt.types import NearObstacles
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import SiteMap


def _nothing() -> Floats:
    return np.empty((0, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentObstacles:
    """Obstacles in addition to those of the site map, metres in the map's frame.

    Attributes:
        seen_m: (N, 2) points of obstacles.
        assumed_m: (M, 2) points where an obstacle is assumed.
        edges_m: (K, 2) points where the ground ends.
    """

    seen_m: Floats = field(default_factory=_nothing)
    assumed_m: Floats = field(default_factory=_nothing)
    edges_m: Floats = field(default_factory=_nothing)


def recent_obstacles(
    obstacles: NearObstacles | None,
    site_map: SiteMap,
    *,
    same_m: float = 0.25,
    least: int = 3,
    unmapped_s: float = math.inf,
) -> RecentObstacles:
    """Return the recently seen obstacles around the drone that are not on the map.

    The map places static obstacles by many views and corrects the drone's drift. Recent points are
    placed by a few views and drift.

    Args:
        obstacles: Points around the drone, in the body frame; None while unknown.
        site_map: The newest map.
        same_m: Points within this distance of a point of the map are dropped as the same.
        least: Smaller groups of points are dropped as errors of a network.
        unmapped_s: Points last seen longer ago are dropped on ground that the map has seen: a lost
            drone may have misplaced them.
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
    """Return the places that are recent, or not on ground that the map has seen."""
    if not len(age_s):
        return places_m
    return places_m[(age_s <= unmapped_s) | ~site_map.lies_on(site_map.ground, places_m)]


def _far_from(known_m: Floats, points_m: Floats, near_m: float) -> Floats:
    """Return the points at least `near_m` from all known ones."""
    if not len(points_m):
        return points_m
    from scipy.spatial import cKDTree  # noqa: PLC0415  (`uav-bt check` must answer at once)

    nearest_m, _ = cKDTree(known_m).query(points_m, distance_upper_bound=near_m)
    return np.asarray(points_m[nearest_m >= near_m])
