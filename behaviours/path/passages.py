"""The clearance maps of wide and narrow passages, and the route through the best of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from behaviours.path.clearance import ClearanceMap, Place, Route
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.site_map import SiteMap


class ClearanceMaps:
    """The clearance maps of each passage, made on first use.

    Attributes:
        map: The site map.

    Args:
        site_map: The newest map.
        recent: Obstacles that are not on the map.
        margins: Margins of the ordinary passage.
        crossing: Whether narrower passages may cross the lanes of movers.
        past_assumed: Whether the tightest passage may cross open ground with assumed obstacles.
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
        past_assumed: bool = False,
        over: Place | None = None,
    ) -> None:
        narrow = replace(site_map, lanes_m=np.empty((0, 2))) if crossing else site_map
        margins_of = {
            Passage.ORDINARY: margins,
            Passage.TIGHT: margins.tight(),
            Passage.TIGHTEST: replace(margins.tightest(), past_assumed=past_assumed),
        }
        if over is not None:
            at_pad = margins.at_pad()
            margins_of |= {Passage.TIGHT: at_pad, Passage.TIGHTEST: at_pad.sure()}
        self._parts = {
            passage: (site_map if passage is Passage.ORDINARY else narrow, each)
            for passage, each in margins_of.items()
        }
        self.map, self._recent, self._over = site_map, recent, over
        self._made: dict[Passage, ClearanceMap] = {}

    def __getitem__(self, passage: Passage) -> ClearanceMap:
        if passage not in self._made:
            site_map, margins = self._parts[passage]
            self._made[passage] = ClearanceMap(site_map, self._recent, margins, over=self._over)
        return self._made[passage]

    def route_to(self, to: Place, *, near_m: float, far_m: float) -> Route | None:
        """Return the route to a place; None without one.

        The route uses the widest passage, unless a narrower one saves `Margins.saved_s`.

        Args:
            to: Place in the map's frame, metres.
            near_m: As in `ClearanceMap.route_to`.
            far_m: As in `ClearanceMap.route_to`.
        """
        best: Route | None = None
        for passage in Passage:
            margins = self._parts[passage][1]
            if best is not None and best.length_m <= margins.direct * best.apart_m:
                break
            found = self[passage].route_to(to, near_m=near_m, far_m=far_m)
            if found is not None and (best is None or found.time_s < best.time_s - margins.saved_s):
                best = found
            if best is not None and passage is Passage.TIGHT:
                break
        return best
