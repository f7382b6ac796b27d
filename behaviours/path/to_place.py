"""The way to a place of the map: along a route, by a last step, or as near as free ground leads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from behaviours.path.clearance import Place
from behaviours.path.following import UNMAPPED_S, follow
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.types import Corridor, NearObstacles
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import SiteMap

_NO_WAY: Final = "no known way"
_UNSEEN: Final = "no known way: the ground there or beside it was not seen"


@dataclass(frozen=True, kw_only=True)
class ToPlaceConfig:
    """How a place is flown to.

    Attributes:
        step_m: From this distance the drone flies to the place by one step. Chosen: the drone
            reaches the end of a route with the error of a cell and of its heading.
        nearer_m: Without a route to the place, one is flown that ends at least this much nearer to
            it. Chosen, as for the landing mark.
    """

    step_m: float = 0.35
    nearer_m: float = 0.5


@dataclass(frozen=True, kw_only=True)
class StepTo:
    """One step in a straight line.

    Attributes:
        forward_m: Distance ahead, in the body frame.
        right_m: Distance to the right.
    """

    forward_m: float
    right_m: float


@dataclass(frozen=True, kw_only=True)
class WayTo:
    """The next part of the way to a place.

    Attributes:
        course: What to fly; None while nothing can be flown.
        left_m: Length of the way that is left.
        bearing_rad: Direction of the place, clockwise from the heading.
        reason: One or two words for the status line.
    """

    course: FollowLeg | Rotate | StepTo | None
    left_m: float
    bearing_rad: float
    reason: str


def way_to(
    place: Place,
    site_map: SiteMap,
    obstacles: NearObstacles | None,
    corridor: Corridor | None,
    *,
    margins: Margins,
    arrive_m: float,
    most_mps: float = math.inf,
    config: ToPlaceConfig | None = None,
) -> WayTo:
    """Return the next part of the way to a place.

    The way keeps the margins to its end. It leads over ground that was seen free.

    Args:
        place: The place, metres in the map's frame.
        site_map: The newest map.
        obstacles: Obstacles seen around the drone.
        corridor: The safety corridor; None without depth.
        margins: Distances that the way keeps.
        arrive_m: Largest distance of the way's end from the place.
        most_mps: Highest speed.
        config: How places are flown to.
    """
    config = config or ToPlaceConfig()
    forward_m, right_m = site_map.pose.to_body(*place)
    apart_m, bearing_rad = math.hypot(forward_m, right_m), math.atan2(right_m, forward_m)
    recent = recent_obstacles(obstacles, site_map, unmapped_s=UNMAPPED_S)
    maps = ClearanceMaps(site_map, recent, margins, crossing=True)
    if apart_m <= config.step_m and maps[Passage.TIGHT].is_open_to(*place):
        step = StepTo(forward_m=forward_m, right_m=right_m)
        return WayTo(course=step, left_m=apart_m, bearing_rad=bearing_rad, reason="last step")
    route = maps.route_to(place, near_m=min(arrive_m, site_map.cell_m), far_m=arrive_m)
    trouble = "" if route is not None else _trouble(place, maps)
    if trouble == _UNSEEN:  # fly as near as known ground leads; from there more is seen
        far_m = apart_m - config.nearer_m
        route = maps[Passage.ORDINARY].route_to(place, near_m=arrive_m, far_m=far_m)
    if route is None or len(route.path_m) == 1:
        return WayTo(
            course=None, left_m=apart_m, bearing_rad=bearing_rad, reason=trouble or _NO_WAY
        )
    left_m = route.length_m + math.dist(route.path_m[-1], place)
    return WayTo(
        course=follow(route, site_map, corridor, most_mps=most_mps),
        left_m=left_m,
        bearing_rad=bearing_rad,
        reason=f"{left_m:.1f} m left",
    )


def _trouble(place: Place, maps: ClearanceMaps) -> str:
    """Return why no route leads to a place."""
    if maps.map.is_beyond_edge(*place):
        return "the place lies beyond the edge of the ground"
    tightest = maps[Passage.TIGHTEST].margins
    if _nearest_m(place, maps.map.obstacles_m) < tightest.touch_m:
        return "no room at the place: an obstacle is too near"
    if _nearest_m(place, maps.map.edges_m) < tightest.edge_m:
        return "no room at the place: the edge of the ground is too near"
    row, column = maps.map.cell_of(*place)
    rows, columns = maps.map.free.shape
    inside = 0 <= row < rows and 0 <= column < columns
    is_open = inside and bool(maps[Passage.TIGHTEST].open[row, column])
    return _NO_WAY if is_open else _UNSEEN


def _nearest_m(place: Place, points_m: Floats) -> float:
    """Return the distance from a place to the nearest point; inf without points."""
    return float(np.hypot(*(points_m - place).T).min(initial=math.inf))
