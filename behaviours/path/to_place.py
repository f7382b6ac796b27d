"""The way to a place of the map: along a route, by a last step, or as near as free ground leads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from behaviours.path.clearance import Place, Route
from behaviours.path.following import UNMAPPED_S, follow
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.room import no_room, no_way
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.types import Corridor
from uav_bt.types.site_map import SiteMap

# From this distance the drone flies to the place by one step. Chosen: the drone reaches the end of
# a route with the error of a cell and of its heading.
LAST_STEP_M: Final = 0.35
# Without a route to the place, one is flown that ends at least this much nearer to it; chosen.
_NEARER_M: Final = 0.5
# A place of the route with less clearance, at this distance, is looked at before it is flown.
_NARROW_M: Final = 0.4
_AHEAD_M: Final = 0.6, 1.2


@dataclass(frozen=True, kw_only=True)
class WayTo:
    """The next part of the way to a place."""

    # What to fly: a course, or one step ahead and to the right, metres; None if nothing can be.
    course: FollowLeg | Rotate | tuple[float, float] | None
    left_m: float  # length of the way that is left
    bearing_rad: float  # direction of the place, clockwise from the heading
    reason: str  # one or two words for the status line
    narrow: Place | None = None  # the narrowest place ahead, if it leaves little room


def way_to(
    place: Place,
    site_map: SiteMap,
    corridor: Corridor | None,
    *,
    margins: Margins,
    arrive_m: float,
    most_mps: float = math.inf,
    over: bool = False,
) -> WayTo:
    """Return the next part of the way to a place.

    The way leads over ground that was seen free, keeps the margins to its end, and ends within
    `arrive_m` of the place.

    Args:
        place: Metres in the map's frame.
        site_map: The newest map.
        corridor: The safety corridor; None without depth.
        margins: Distances that the way keeps.
        arrive_m: Largest distance of the way's end from the place.
        most_mps: Highest speed.
        over: Whether the place is the landing mark: the way leads over it, and its last metres may
            be narrower.
    """
    forward_m, right_m = site_map.pose.to_body(*place)
    apart_m, bearing_rad = math.hypot(forward_m, right_m), math.atan2(right_m, forward_m)
    recent = recent_obstacles(site_map.near, site_map, unmapped_s=UNMAPPED_S)
    at = place if over else None
    maps = ClearanceMaps(site_map, recent, margins, crossing=True, over=at)
    course: FollowLeg | Rotate | tuple[float, float] | None = None
    left_m, narrow = apart_m, None
    if apart_m <= LAST_STEP_M and maps[Passage.TIGHT].is_open_to(*place):
        course, reason = (forward_m, right_m), "last step"
    else:
        route = maps.route_to(place, near_m=min(arrive_m, site_map.cell_m), far_m=arrive_m)
        leads_there = route is not None
        if route is None and (over or _may_be_unseen(place, maps)):
            # Fly as near as known ground leads; from there more is seen.
            far_m = apart_m - _NEARER_M
            route = maps[Passage.ORDINARY].route_to(place, near_m=arrive_m, far_m=far_m)
        if route is None or len(route.path_m) == 1:
            reason = no_room(place, maps) if leads_there else no_way(place, maps, arrive_m=arrive_m)
        else:
            left_m = route.length_m + math.dist(route.path_m[-1], place)
            course = follow(route, site_map, corridor, most_mps=most_mps)
            reason, narrow = f"{left_m:.1f} m left", _narrow_place(route)
            if course is None and corridor is not None:
                reason = f"{corridor.free_distance_m:.2f} m to something that the map does not have"
            elif isinstance(course, FollowLeg) and course.speed_mps == 0.0:
                reason = "waits for a mover"
            elif apart_m <= LAST_STEP_M and not maps[Passage.TIGHT].is_open(place):
                reason = no_room(place, maps)
    return WayTo(
        course=course, left_m=left_m, bearing_rad=bearing_rad, reason=reason, narrow=narrow
    )


def _narrow_place(route: Route) -> Place | None:
    """Return the narrowest place at the distance from which the camera shows its sides."""
    apart_m = np.hypot(*(route.path_m - route.path_m[0]).T)
    clear_m = np.where((apart_m > _AHEAD_M[0]) & (apart_m < _AHEAD_M[1]), route.clear_m, math.inf)
    x_m, y_m = route.path_m[clear_m.argmin()]
    return (float(x_m), float(y_m)) if clear_m.min() < _NARROW_M else None


def _may_be_unseen(place: Place, maps: ClearanceMaps) -> bool:
    """Return whether nothing that was seen is too near to a place where no route ends."""
    found, widest = maps.map, maps[Passage.OUT]
    limits_m = (found.obstacles_m, widest.margins.touch_m), (found.edges_m, widest.margins.edge_m)
    near = any((np.hypot(*(points_m - place).T) < least_m).any() for points_m, least_m in limits_m)
    return not (near or widest.is_open(place) or found.is_beyond_edge(*place))
