"""The clearance maps of wide and narrow passages, and the route through the best of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap, Distances, Place, Route
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles, near_first
from uav_bt.types.site_map import SiteMap

_SAVED_S: Final = 6.0  # s; least time that a narrower passage must save
_AROUND_M: Final = 1.0  # a gap is searched up to this distance around the drone and the mark
_SPLIT: Final = 4  # cells of a gap, along each side of a cell of the map: 2.5 cm
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
            the last metres before the mark, and the way out is `_gap`.
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
        self.map, self.recent, self._margins = site_map, recent, margins
        self._crossing, self._over = crossing, over
        self._distances = Distances(site_map, recent)
        self._made: dict[Passage, ClearanceMap] = {}

    def __getitem__(self, passage: Passage) -> ClearanceMap:
        if passage not in self._made and passage is Passage.OUT and self._over is not None:
            self._made[passage] = self._gap(self._over)
        elif passage not in self._made:
            found, at_pad = self.map, self._over is not None
            shut_in = passage is Passage.OUT and self[Passage.TIGHT].shut_in
            margins = self._margins.through(passage, at_pad=at_pad, shut_in=shut_in)
            if self._crossing and passage is not Passage.ORDINARY:
                found = replace(found, lanes_m=np.empty((0, 2)))
            self._made[passage] = ClearanceMap(
                found, self.recent, margins, over=self._over, distances=self._distances
            )
        return self._made[passage]

    def _gap(self, mark: Place) -> ClearanceMap:
        """Return the clearance map of gaps that leave the hull a few centimetres.

        Its cells are smaller, and the obstacles that were seen lately stand for those of the map.
        """
        tight, cell_m = self[Passage.TIGHT], self.map.cell_m / _SPLIT
        found = near_first(tight.map)
        # The part around the drone and the mark.
        ends = found.cell_of(found.pose.x_m, found.pose.y_m), found.cell_of(*mark)
        around = round(_AROUND_M / found.cell_m)
        first = np.maximum(np.min(ends, axis=0) - around, 0)
        rows, columns = map(slice, first, np.max(ends, axis=0) + around + 1)
        x_m, y_m = found.middles_m(first) + (cell_m - found.cell_m) / 2

        def split(cells: NDArray[Any]) -> NDArray[Any]:
            return cells[rows, columns].repeat(_SPLIT, axis=0).repeat(_SPLIT, axis=1)

        fine = replace(
            found,
            cell_m=cell_m,
            corner_m=(float(x_m), float(y_m)),
            seen_s=split(found.seen_s),
            free=split(~(tight.unknown() | found.outside)),
            outside=split(found.outside),
            passed=split(found.passed),
        )
        return ClearanceMap(fine, self.recent, self._margins.in_gap(), over=mark)

    def _in_gap(self, passage: Passage) -> bool:
        """Return whether the drone has less room than a wider passage, before the mark."""
        if self._over is None or passage is Passage.OUT:
            return False
        return not self[passage].roomy[self[passage].start]

    def route_to(self, to: Place, *, near_m: float, far_m: float) -> Route | None:
        """Return the route to a place through the widest passage, unless a narrower saves time.

        `to`, `near_m` and `far_m` are those of `ClearanceMap.route_to`.
        """
        best: Route | None = None
        # In a gap, wider passages know no more than the way out of it: they come last.
        for passage in sorted(Passage, key=self._in_gap):
            if best is not None and best.length_m <= _DIRECT * best.apart_m:
                break
            found = self[passage].route_to(to, near_m=near_m, far_m=far_m)
            if found is not None and (best is None or found.time_s < best.time_s - _SAVED_S):
                best = found
            if best is not None and passage is not Passage.ORDINARY:
                break
        return best
