"""The clearance maps of wide and narrow passages, and the route through the best of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from behaviours.path.clearance import ClearanceMap, Distances, Place, Route
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.site_map import SiteMap

_SAVED_S: Final = 6.0  # s; least time that a narrower passage must save
_DIRECT: Final = 1.3  # a route up to this multiple of the straight line needs no narrower passage


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


class ClearanceMaps:
    """The clearance maps of each passage, made on first use.

    Args:
        site_map: The newest map.
        recent: Obstacles that are not on the map.
        margins: Margins of the ordinary passage.
        crossing: Whether narrower passages may cross the lanes of movers.
        over: Landing mark that routes may lead over. With it, narrower passages use the margins of
            the last metres before the mark.
    """

    def __init__(
        self,
        site_map: SiteMap,
        recent: RecentObstacles,
        margins: Margins,
        *,
        crossing: bool = False,
        over: Place | None = None,
    ) -> None:
        self.map, self._recent, self._margins = site_map, recent, margins
        self._crossing, self._over = crossing, over
        self._distances = Distances(site_map, recent)
        self._made: dict[Passage, ClearanceMap] = {}

    def __getitem__(self, passage: Passage) -> ClearanceMap:
        if passage not in self._made:
            found, at_pad = self.map, self._over is not None
            shut_in = passage is Passage.OUT and self[Passage.TIGHT].shut_in
            margins = self._margins.through(passage, at_pad=at_pad, shut_in=shut_in)
            if self._crossing and passage is not Passage.ORDINARY:
                found = replace(found, lanes_m=np.empty((0, 2)))
            self._made[passage] = ClearanceMap(
                found, self._recent, margins, over=self._over, distances=self._distances
            )
        return self._made[passage]

    def route_to(self, to: Place, *, near_m: float, far_m: float) -> Route | None:
        """Return the route to a place through the widest passage, unless a narrower saves time.

        `to`, `near_m` and `far_m` are those of `ClearanceMap.route_to`.
        """
        best: Route | None = None
        for passage in Passage:
            if best is not None and best.length_m <= _DIRECT * best.apart_m:
                break
            found = self[passage].route_to(to, near_m=near_m, far_m=far_m)
            if found is not None and (best is None or found.time_s < best.time_s - _SAVED_S):
                best = found
            if best is not None and passage is not Passage.ORDINARY:
                break
        return best
