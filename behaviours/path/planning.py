"""Route planning to a place over the site map."""

from __future__ import annotations

from behaviours.path.clearance import ClearanceMap, Place, Route
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.site_map import SiteMap


def route(
    site_map: SiteMap,
    to: Place,
    margins: Margins | None = None,
    *,
    recent: RecentObstacles | None = None,
    near_m: float = 0.1,
) -> Route | None:
    """Return the fastest route from the drone to a place.

    Args:
        site_map: The newest map, with the drone's pose.
        to: (x, y) of the place, metres in the map's frame.
        margins: Distances that the route keeps, and its speeds; `Margins().at_pad()` for the last
            metres before the landing mark.
        recent: Obstacles in addition to those of the map, as `recent_obstacles` returns them.
        near_m: Largest distance from the route's end to the place.

    Returns:
        The route; None if no route keeps the margins.
    """
    clearance = ClearanceMap(site_map, recent or RecentObstacles(), margins)
    return clearance.route_to(to, near_m=near_m, far_m=near_m)
