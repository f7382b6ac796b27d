"""Recently seen obstacles around the drone that are not on the site map."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from uav_bt.types import NearObstacles
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import SiteMap

_SAME_M: Final = 0.25  # points within this distance of a point of the map are dropped as the same
_LEAST: Final = 3  # smaller groups of points are dropped as errors of a network
_BESIDE_M: Final = 0.1  # points of a side have others within this distance
_OUTLINE_M: Final = 0.1  # between the points on the sides of an object


@dataclass(frozen=True, kw_only=True, eq=False)
class RecentObstacles:
    """Obstacles in addition to those of the site map, metres in the map's frame."""

    # (N, 2) points of obstacles
    seen_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    # (M, 2) points where an obstacle is assumed
    assumed_m: Floats = field(default_factory=lambda: np.empty((0, 2)))
    # (K, 2) points where the ground ends
    edges_m: Floats = field(default_factory=lambda: np.empty((0, 2)))


def recent_obstacles(
    obstacles: NearObstacles | None, site_map: SiteMap, *, unmapped_s: float = math.inf
) -> RecentObstacles:
    """Return the recently seen obstacles around the drone that are not on the map.

    The map places static obstacles by many views and corrects the drone's drift. Recent points are
    placed by a few views and drift. Those last seen longer than `unmapped_s` ago are dropped on
    ground that the map has seen: a lost drone may have misplaced them.
    """
    from behaviours.path.compiled_loops import has_near  # noqa: PLC0415  (see that module)

    if obstacles is None:
        return RecentObstacles()
    to_map = site_map.pose.points_to_world

    def believed(points_m: Floats, age_s: Floats) -> Floats:
        places_m, old = to_map(points_m), age_s > unmapped_s
        if not old.any():
            return places_m
        return places_m[~(old & site_map.lies_on(site_map.ground, places_m))]

    points_m = believed(obstacles.points_m, obstacles.points_age_s)
    edges_m = believed(obstacles.edges_m, obstacles.edges_age_s)
    new_m = points_m[~has_near(points_m, site_map.obstacles_m, _SAME_M, 1)]
    return RecentObstacles(
        seen_m=new_m[has_near(new_m, new_m, _SAME_M, _LEAST)],
        assumed_m=to_map(obstacles.assumed_m),
        edges_m=edges_m[~has_near(edges_m, site_map.edges_m, _SAME_M, 1)],
    )


def sides_m(site_map: SiteMap, within_m: float = math.inf) -> Floats:
    """Return points around the objects near the drone, of which one or two sides were seen."""
    here = site_map.pose.x_m, site_map.pose.y_m
    near = [
        each.outline_m(_OUTLINE_M)
        for each in site_map.objects
        if math.dist((each.x_m, each.y_m), here) <= within_m + math.hypot(each.size_m, each.width_m)
    ]
    return np.vstack([np.empty((0, 2)), *near])


def near_first(site_map: SiteMap) -> SiteMap:
    """Return the map with the recently seen points in place of what it has there.

    The map may be off by 5 to 10 cm, recent points by 1 to 2 cm.
    """
    from behaviours.path.compiled_loops import has_near  # noqa: PLC0415  (see that module)

    known_m = np.vstack([site_map.obstacles_m, sides_m(site_map)])
    seen_m = site_map.pose.points_to_world(site_map.near.points_m)
    is_new = ~has_near(seen_m, known_m, _SAME_M, 1) & has_near(seen_m, seen_m, _SAME_M, _LEAST)
    seen_m = seen_m[is_new | has_near(seen_m, seen_m, _BESIDE_M, _LEAST)]
    unseen_m = known_m[~has_near(known_m, seen_m, _SAME_M, 1)]
    return replace(site_map, obstacles_m=np.vstack([seen_m, unseen_m]), objects=())
